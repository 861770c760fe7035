"""Path geometry: rasters, key points, the alignment path, coverage and decimation."""
