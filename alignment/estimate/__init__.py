"""Where the part is: key-point method, point-to-surface MAP estimate, its uncertainty and its verdict."""
