"""Calibrations from data of the same kind as scans: tilt loss, couplant, TCP. Each returns a patch of `setup.json`."""

from alignment.calibrate.couplant import calibrate_couplant
from alignment.calibrate.result import Calibration, Estimate
from alignment.calibrate.run import calibrate
from alignment.calibrate.sphere import calibrate_tcp_sphere
from alignment.calibrate.tcp import calibrate_tcp
from alignment.calibrate.tilt import calibrate_tilt

__all__ = [
    "Calibration",
    "Estimate",
    "calibrate",
    "calibrate_couplant",
    "calibrate_tcp",
    "calibrate_tcp_sphere",
    "calibrate_tilt",
]
