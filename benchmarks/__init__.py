"""The ratios EchoBase publishes, measured in one run on one machine: `make bench`."""

import os

# As the application sets it, before numpy is imported.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
