"""Do claimed 95 % regions contain the truth? Simulated scans through the whole estimate, noise of three correlation lengths.

    python -m benchmarks.alignment.calibration [--scans 1000] [--length 8 30 150] [--first 0] [--edges]

Prints, per length: the share of scans whose truth lies in the claimed 95 % region (chi-square, six degrees of freedom),
the mean squared Mahalanobis distance (6 if calibrated; less: inflated), and its square root per measured direction.
"""

import argparse
import time

import numpy as np
from scipy.stats import chi2

from alignment.estimate.map import MapFit, align_map
from alignment.estimate.motion import motion_between, moved
from planner.placement import assume_nominal
from planner.setup import Setup
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import plane

LINES = {False: ((5, 145), [12.5 + 18.75 * k for k in range(5)]), True: ((-8, 158), [20.0 * k for k in range(6)])}


def one(seed: int, length_mm: float, edges: bool, surface, curved, setup: Setup) -> tuple[float, np.ndarray]:
    """Return the squared Mahalanobis distance of the truth, and the errors in claimed sigmas along the known directions."""
    rng = np.random.default_rng([seed, round(length_mm)])
    prior = np.repeat([np.radians(setup.fixture.sigma_deg), setup.fixture.sigma_mm], 3)
    nominal = assume_nominal(setup.T_base_partnom)
    centre = nominal.points(curved.surface.centroid_part)
    T_true = moved(nominal, prior * rng.standard_normal(6), centre)
    cloud = scan(surface, setup, T_true, rng, *LINES[edges], correlation_mm=length_mm)
    found = align_map(cloud, curved, setup, edges)
    if not isinstance(found, MapFit):
        return np.inf, np.zeros(0)
    xi = motion_between(found.T_base_part, T_true, found.centre_mm)
    known = [d for d in found.directions if d.status != "held"]
    along = np.array([d.vector / prior @ (xi / prior) / d.sigma for d in known])
    return float(xi @ np.linalg.solve(found.covariance, xi)), along


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--length", type=float, nargs="+", default=[8.0, 30.0, 150.0])
    parser.add_argument("--edges", action="store_true")
    asked = parser.parse_args()
    surface = plane()
    curved, setup = curved_of(surface), Setup()
    limit = chi2.ppf(0.95, 6)
    for length in asked.length:
        start = time.process_time()
        found = [
            one(s, length, asked.edges, surface, curved, setup) for s in range(asked.first, asked.first + asked.scans)
        ]
        m2 = np.array([f[0] for f in found])
        rms = [float(np.sqrt(np.mean(f[1] ** 2))) for f in found if len(f[1])]
        print(
            f"edges {asked.edges} length {length:g} mm: {np.mean(m2 <= limit):.3f} of {len(m2)} inside, mean square "
            f"{np.mean(m2):.2f} (median {np.median(m2):.2f}), rms of known {np.sqrt(np.mean(np.square(rms))):.2f}, "
            f"{(time.process_time() - start) / len(m2):.2f} s each",
            flush=True,
        )


if __name__ == "__main__":
    main()
