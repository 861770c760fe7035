"""The full-density path for the acquisition side: the robot needs few poses, the C-scan wants them all."""

import numpy as np
import polars as pl

from kuka_export.numbers import DEG_DECIMALS, MM_DECIMALS, written_frames
from planner.placement import assume_nominal
from planner.probe import tool_axes
from planner.setup import Setup
from planner.toolpath import Role, ToolPath

_ROLES = np.array([role.name.lower() for role in Role])
_DECIMALS = (MM_DECIMALS,) * 3 + (DEG_DECIMALS,) * 3
_NORMAL_DECIMALS = 6


def dense_csv(path: ToolPath, setup: Setup) -> bytes:
    """Return the poses of a path as CSV: pass, role, pose of the tool as taught, outward normal; in the program's base.

    Columns `pass` (from 1), `role`, `x_mm .. c_deg`, `nx, ny, nz`, `standoff_mm`. The numbers hold in the nominal base and in
    the corrected one alike: a rigid correction moves the base, not the poses in it.
    """
    T_base_part = assume_nominal(setup.T_base_partnom)
    poses = written_frames((T_base_part @ path.Ts_part_tcp @ tool_axes(setup.tool).inv()).xyzabc)
    normals = np.round(T_base_part.directions(path.Ts_part_contact.rotation_matrix[:, :, 2]), _NORMAL_DECIMALS) + 0.0
    columns: dict[str, pl.Series] = {
        "pass": pl.Series(path.pass_id.astype(np.int64) + 1),
        "role": pl.Series(_ROLES[path.role]),
    }
    for k, name in enumerate(("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")):
        columns[name] = pl.Series(np.round(poses[:, k], _DECIMALS[k]))
    for k, name in enumerate(("nx", "ny", "nz")):
        columns[name] = pl.Series(normals[:, k])
    columns["standoff_mm"] = pl.Series(np.round(path.standoff_mm, MM_DECIMALS))
    return pl.DataFrame(columns).write_csv().encode("ascii")
