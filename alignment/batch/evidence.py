"""`PartEvidence`: what the scan of one part says of its placement, freed of what the fixture's prior had added."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from planner.errors import fail
from planner.frames import AXES, Array, Transform

# Least share of a direction that must lie in what the scan shows, for the part to count there: as for named axes of a
# correction, of whose prior no more than a quarter may be held.
SEEN_SHARE = 1.0 - 0.25**2


@dataclass(frozen=True, eq=False)
class PartEvidence:
    """One part. Motions are (rx, ry, rz, x, y, z) about the nominal centroid, axes of base, in prior standard deviations.

    seen (6, k): orthonormal directions that the scan shows. values (k,), sigma (k,): the part's place along them by the
    scan alone, and its standard deviation. prior_sigma (6,): rad and mm. centre_mm (3,): nominal centroid, base.
    """

    name: str
    seen: Array
    values: Array
    sigma: Array
    prior_sigma: Array
    centre_mm: Array

    def along(self, direction: Array) -> tuple[float, float] | None:
        """Return (value, variance) of the part's place along a unit direction (6,), or None where the scan does not show it.

        What of the direction is not seen is as uncertain as before the scan: it counts with the prior's variance.
        """
        parts = self.seen.T @ direction
        share = float(parts @ parts)
        if share < SEEN_SHARE:
            return None
        return float(parts @ self.values), float(parts**2 @ self.sigma**2 + max(1.0 - share, 0.0))


def evidence_of(name: str, content: Mapping[str, Any]) -> PartEvidence:
    """Return the evidence of a correction.json.

    A correction leans towards nominal by its prior: with posterior sigma s (in prior ones) along a direction, the scan alone
    says estimate / (1 - s^2), with variance s^2 / (1 - s^2). Held directions say nothing.
    Raises EchoBaseError `batch-correction` if the file states no correction with its directions.
    """
    try:
        if content["verdict"] == "fail" or content["correction"] is None or len(content["directions"]) != 6:
            raise KeyError("correction")
        six = [float(content["correction"][f"{k}_{'mm' if k in 'xyz' else 'deg'}"]) for k in AXES]
        centroid = np.array(content["centroid_mm"], dtype=np.float64).reshape(3)
        found = content["directions"]
        vectors = np.array([d["vector"] for d in found], dtype=np.float64).reshape(6, 6)
        sigma = np.array([d["sigma"] for d in found], dtype=np.float64)
        held = np.array([d["status"] == "held" for d in found])
    except (KeyError, TypeError, ValueError) as error:
        raise fail(
            "batch-correction",
            "This is no correction with directions: it failed, or it is another kind of file.",
            "Name correction.json of an alignment by the map method whose verdict is not fail.",
            name,
        ) from error
    T = Transform.from_xyzabc("base", "basecorr", six)
    centre = T.inv().points(centroid)
    # Vectors are whole sets of prior standard deviations: their squares add up to the prior.
    prior = np.sqrt((vectors**2).sum(axis=0))
    moved = np.r_[T.rotation.as_rotvec(), centroid - centre] / prior
    seen = np.linalg.qr((vectors / prior)[~held].T)[0] if (~held).any() else np.zeros((6, 0))
    # QR only tidies rounding; signs are those of the directions themselves.
    seen = seen * np.sign((seen * (vectors / prior)[~held].T).sum(axis=0))
    data = 1.0 - np.minimum(sigma[~held], 0.999) ** 2
    return PartEvidence(name, seen, (seen.T @ moved) / data, sigma[~held] / np.sqrt(data), prior, centre)
