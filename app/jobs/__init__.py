"""Slow work: pure functions run in worker processes (or on a Dask cluster), with progress and cancellation."""
