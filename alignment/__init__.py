"""From scan data to a correction: readers, point cloud, estimators, observability, metrics, and the simulated scanner."""
