"""What is believed of a robot's noise before a residual is seen."""

from dataclasses import dataclass

import numpy as np

from planner.frames import Array


@dataclass(frozen=True, eq=False)
class NoisePrior:
    """Split normals of the logarithms, in the order of `noise_kernel.NAMES`: mode, spread below and above it, (9,) each."""

    centre: Array
    below: Array
    above: Array

    def precision(self, theta: Array) -> Array:
        """Return the inverse variances (9,) on the side where theta (9,) is."""
        return np.where(theta < self.centre, self.below, self.above) ** -2.0

    def log_density(self, theta: Array) -> Array:
        """Return the terms (9,) of the logarithm of the density, but for a constant."""
        return -0.5 * self.precision(theta) * (theta - self.centre) ** 2


def noise_prior(scatter_mm: float, part_size_mm: float, swath_mm: float) -> NoisePrior:
    """Return what is believed before seeing a residual.

    A robot that wanders by a few hundredths of a millimetre and thousandths of a degree, hardly less but easily more,
    over lengths from millimetres to the size of the part; a part whose form differs from CAD by microns or by much more.
    """
    tilt = np.radians(0.005) * 0.5 * swath_mm
    centre = [scatter_mm, 0.03, 60.0, 30.0, max(tilt, 1e-4), 0.002, 0.25 * part_size_mm, 0.1, 0.045]
    below = [0.7, 0.5, 1.6, 1.8, 0.5, 1.0, 0.8, 1.0, 0.6]
    above = [0.7, 1.2, 1.6, 1.5, 1.2, 1.5, 0.8, 1.0, 0.6]
    return NoisePrior(np.log(centre), np.array(below), np.array(above))
