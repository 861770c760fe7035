"""Planning on eight analytic panels: accuracy and time, beside trimesh's slicing."""
