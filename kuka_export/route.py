"""`Route`: the poses of a tool path as a program commands them, with what each motion is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kuka_export.numbers import written_frames
from kuka_export.options import ProgramOptions
from planner.frames import Array, Transform
from planner.probe import tool_axes
from planner.setup import Setup
from planner.toolpath import PathKind, Role, ToolPath

_SCAN_ROLES = (Role.LEAD_IN, Role.DATA, Role.LEAD_OUT)


@dataclass(frozen=True, eq=False)
class Route:
    """n poses in the program's base and what the motion to each is.

    Ts_tcp: EchoBase's TCP (beam z), stack in `base` or `basecorr`. poses (n, 6): X Y Z A B C of the tool as taught.
    scan (n,): lead-in, data or lead-out. arrival (n,): first pose of a run of scan poses. source (n,): row of the tool
    path. speed_mm_s (n,): of the motion that ends at the pose.
    """

    kind: PathKind
    Ts_tcp: Transform
    poses: Array
    role: NDArray[np.uint8]
    pass_id: NDArray[np.int32]
    scan: NDArray[np.bool_]
    arrival: NDArray[np.bool_]
    speed_mm_s: Array
    source: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.poses)


def route(path: ToolPath, setup: Setup, options: ProgramOptions, T_base_part: Transform) -> Route:
    """Return the route of a path for `T_base_part` (or `T_basecorr_part`: the same numbers), without repeated poses.

    A pose that repeats its neighbour to rounding is dropped unless both take data: standing still is a fault of its own
    on the controller (message 1456), and planners end a link where the approach begins.
    """
    Ts_tcp = T_base_part @ path.Ts_part_tcp
    poses = (Ts_tcp @ tool_axes(setup.tool).inv()).xyzabc
    keep = without_repeats(poses, path.role)
    role, pass_id = path.role[keep], path.pass_id[keep]
    scan = np.isin(role, _SCAN_ROLES)
    arrival = scan & ~(shifted(scan, False) & (shifted(pass_id, -1) == pass_id))
    scan_speed = scan_speed_mm_s(path.kind, setup, options)
    speed = np.where(scan, scan_speed, options.link_speed_mm_s)
    speed[arrival | (role == Role.RETRACT)] = options.approach_speed_mm_s
    return Route(path.kind, Ts_tcp[keep], poses[keep], role, pass_id, scan, arrival, speed, keep)


def scan_speed_mm_s(kind: PathKind, setup: Setup, options: ProgramOptions) -> float:
    """Return the speed while taking data (mm/s)."""
    if options.scan_speed_mm_s is not None:
        return options.scan_speed_mm_s
    return setup.alignment.scan_speed_mm_s if kind == "alignment" else setup.inspection.scan_speed_mm_s


def repeats(poses: Array) -> NDArray[np.bool_]:
    """Return which poses (n, 6) carry the numbers of the pose before them (n,)."""
    if len(poses) == 0:
        return np.zeros(0, dtype=bool)
    w = written_frames(poses)
    return np.concatenate([[False], (w[1:] == w[:-1]).all(axis=1)])


def without_repeats(poses: Array, role: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Return the rows to keep: of two equal neighbours the one that takes data, else the earlier; DATA rows always stay."""
    keep = np.arange(len(poses))
    while True:
        again = np.flatnonzero(repeats(poses[keep]))
        data = role[keep] == Role.DATA
        drop = np.where(~data[again], again, again - 1)
        drop = drop[~data[drop]]
        if len(drop) == 0:
            return keep
        keep = np.delete(keep, np.unique(drop))


def shifted(values: NDArray, first: object) -> NDArray:
    """Return each row's predecessor, `first` before the first."""
    out = np.roll(values, 1)
    out[:1] = first
    return out


def data_switches(route_: Route) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the first and last poses of every run of DATA poses, (n,) each."""
    data = route_.role == Role.DATA
    same = shifted(route_.pass_id, -1) == route_.pass_id
    first = data & ~(shifted(data, False) & same)
    end = np.roll(first | ~data, -1)
    end[-1:] = True
    return first, data & end


def spacing_mm(poses: Array) -> Array:
    """Return the distance of each pose from the one before it (n,), mm; the first is inf."""
    steps = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
    return np.concatenate([[np.inf], steps]) if len(poses) else np.zeros(0)
