"""Benchmarks of the alignment: calibration of its claims, and speed beside other libraries."""
