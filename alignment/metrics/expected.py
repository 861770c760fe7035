"""What each pose of a path will see of the part, before it is run."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from alignment.metrics.figures import WITHIN_DB, Prediction, loss_db, spread, tilts_deg
from planner.frames import Array, Transform
from planner.placement import assume_nominal
from planner.setup import Setup
from planner.surface.closest import Foot
from planner.toolpath import ToolPath


class Closest(Protocol):
    """The part of `planner.surface.curved.CurvedSurface` used here."""

    def closest(self, points_part: Array) -> Foot:
        """Return the feet of points (n, 3) in `part`, mm."""
        ...


@dataclass(frozen=True, eq=False)
class Expected:
    """Per pose (n,), of the centre law (the TCP axis).

    distance_mm: from the law origin to the surface, perpendicular. standoff_mm: from the TCP. b_deg, c_deg: tilts about
    TCP y and x; tilt_deg: angle between beam and inward normal. db: amplitude change through tilt. on_part: the foot of
    the beam is on the inspection surface; poses beyond its edge take no part in the summary.
    """

    distance_mm: Array
    standoff_mm: Array
    b_deg: Array
    c_deg: Array
    tilt_deg: Array
    db: Array
    on_part: NDArray[np.bool_]
    summary: Prediction


def expected(curved: Closest, path: ToolPath | Transform, setup: Setup, T_base_part: Transform) -> Expected:
    """Return what a path sees of the part at `T_base_part`.

    path: a ToolPath, run where the program believes the part is (its data poses are judged); or `Ts_base_tcp`, poses of
    EchoBase's TCP (beam z, array x) in the nominal base. For a corrected program pass the ToolPath and the part where
    the correction leaves it: `inv(T_base_basecorr) @ T_base_part`.
    """
    if isinstance(path, ToolPath):
        Ts_base_tcp = assume_nominal(setup.T_base_partnom) @ path.take(path.is_data).Ts_part_tcp
    else:
        Ts_base_tcp = path
    Ts_part_tcp = T_base_part.inv() @ Ts_base_tcp
    rotation, tcp = Ts_part_tcp.rotation_matrix, Ts_part_tcp.xyz_mm
    arrays, beams = rotation[:, :, 0], rotation[:, :, 2]
    foot = curved.closest(tcp)
    standoff = foot.distance_mm
    # The law's origin lies `face_offset_mm` behind the TCP along the beam; its own foot is asked for, since the
    # offset may be long beside the radius of curvature.
    back = setup.probe.face_offset_mm
    at_origin = curved.closest(tcp - back * beams) if back else foot
    b_deg, c_deg = tilts_deg(beams, arrays, at_origin.normals)
    db = loss_db(b_deg, c_deg, setup.probe)
    cosine = np.clip(-(at_origin.normals * beams).sum(axis=1), -1.0, 1.0)
    tilt = np.degrees(np.arctan2(np.linalg.norm(np.cross(at_origin.normals, beams), axis=1), cosine))
    on_part = np.asarray(at_origin.interior, dtype=bool)
    std, width = spread(at_origin.distance_mm[on_part])
    summary = Prediction(
        tof_std_mm=std,
        tof_range_mm=width,
        tilt_max_deg=float(tilt[on_part].max()) if on_part.any() else float("nan"),
        within_2db=float((db[on_part] >= -WITHIN_DB).mean()) if on_part.any() else float("nan"),
        mean_abs_db=float(np.abs(db[on_part]).mean()) if on_part.any() else float("nan"),
    )
    return Expected(at_origin.distance_mm, standoff, b_deg, c_deg, tilt, db, on_part, summary)
