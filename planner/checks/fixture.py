"""Does the fixture's tolerance still fit in the standoff of the alignment scan?"""

import numpy as np

from planner.frames import Array
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.toolpath import ToolPath


def fixture_reach_mm(curved: CurvedSurface, path: ToolPath, setup: Setup) -> Array:
    """Return how far the fixture's tolerance moves the surface along the normal, two sigma (n,), mm, at each pose.

    Displacement t and small turn w of the part about the centroid c of the inspection surface move the contact point p
    by t + w x (p - c); along the normal n that is n.t + w.((p - c) x n), with independent sigmas per axis (`fixture`).
    """
    contact = path.Ts_part_contact
    normal = contact.rotation_matrix[:, :, 2]
    lever = np.cross(contact.xyz_mm - curved.surface.centroid_part, normal)
    sigma_turn = np.radians(setup.fixture.sigma_deg) * np.linalg.norm(lever, axis=1)
    return np.asarray(2.0 * np.hypot(setup.fixture.sigma_mm, sigma_turn))
