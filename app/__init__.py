"""HTTP, 3D view, store, jobs, report and command line, all thin over `app.workflow`."""

import os

# Our matrices are small: a second BLAS thread gains nothing, and where cores are busy the threads wait for each other
# (measured: an alignment of 14,000 readings 3 s with one thread, 46 s with two on a loaded machine). Must be set before
# numpy is imported; a user's own setting stands.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
