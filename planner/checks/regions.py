"""Keep-out regions that keep nothing out: typed in the wrong place, most likely."""

import numpy as np

from planner.issues import Issue
from planner.path.sampling import sample_equal_area
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.keepouts import keep_outs_of

_SAMPLES = 20_000


def region_issues(curved: CurvedSurface, setup: Setup) -> list[Issue]:
    """Return a warning for every keep-out region that, with its margin, touches nothing of the inspection surface."""
    keep = keep_outs_of(curved.surface, setup)
    if not len(keep):
        return []
    areas = curved.surface.face_areas_mm2
    s = sample_equal_area(areas, _SAMPLES)
    points = np.einsum("nk,nkj->nj", s.bary, curved.surface.vertices[curved.surface.faces[s.face]])
    room = keep.each_room_mm(points).min(axis=1)
    # Between samples lies about this much.
    blur = 2.0 * np.sqrt(float(areas.sum()) / _SAMPLES)
    return [
        Issue(
            "warning",
            "keep-out-elsewhere",
            f"The keep-out region '{keep.label(i)}' lies {gap:.0f} mm from the inspection surface: it keeps nothing out.",
            "Correct its place: keep-outs are in CAD coordinates and mm.",
            f"setup.json: inspection.keep_outs[{i}]",
        )
        for i, gap in enumerate(room)
        if gap > blur
    ]
