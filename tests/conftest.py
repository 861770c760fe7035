"""Settings of the whole suite: the same examples on every run."""

from hypothesis import HealthCheck, settings

import app  # noqa: F401 - sets the number of BLAS threads before numpy is imported

settings.register_profile(
    "echobase",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("echobase")
