"""The inspection surface: which triangles, their edges, and the smooth surface behind them."""
