"""Other ways to read a scan: what would have to be wrong for it to look like this?"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.pose_line import pose_line
from alignment.estimate.readings import sample_rows
from planner.frames import Array, Transform
from planner.probe import law_offsets_mm
from planner.setup import Setup

LENGTH_SCALES = (("metres", 1000.0), ("inches", 25.4), ("centimetres", 10.0), ("micrometres", 1e-3))
TIME_SCALES = (("nanoseconds", 1e-3), ("milliseconds", 1e3), ("seconds", 1e6), ("microseconds one way", 2.0))


@dataclass(frozen=True)
class Hypothesis:
    """A wrong input: its code, the sentence about it and the remedy, and the scan as it should have been.

    of_laws: it moves the laws within their poses and nothing else, so that residuals of both readings can be compared.
    """

    code: str
    message: str
    remedy: str
    apply: Callable[[PointCloud], PointCloud]
    of_laws: bool = False


def thinned(cloud: PointCloud, size: int) -> PointCloud:
    """Return a cloud of at most `size` readings and no lost echoes, enough to see whether a reading fits."""
    rows = sample_rows(len(cloud), size)
    pick = lambda v: None if v is None else v[rows]  # noqa: E731
    none3, none = np.zeros((0, 3)), np.zeros(0, dtype=np.int32)
    return PointCloud(
        cloud.origins_base[rows], pick(cloud.beams_base), pick(cloud.arrays_base), cloud.distance_mm[rows],
        cloud.amplitude_pct[rows], cloud.law[rows], cloud.pose_index[rows], cloud.pass_id[rows], cloud.scan_id[rows],
        none3, none, none.copy(), none3.copy(), none.copy(), len(rows),
    )  # fmt: skip


def array_hypotheses(setup: Setup) -> Iterator[Hypothesis]:
    """Yield ways in which the array may be mounted or numbered other than said."""
    if setup.probe.laws < 2:
        return
    yield Hypothesis(
        "laws-reversed",
        "the readings fit the part only with the laws in reverse order.",
        f"Set probe.reversed to {str(not setup.probe.reversed).lower()}.",
        lambda c: _along(c, setup, lambda a, b: -a),
        of_laws=True,
    )
    for sign, name in ((1.0, "+90"), (-1.0, "-90")):
        yield Hypothesis(
            "array-turned",
            f"the readings fit the part only with the array turned by {name} deg about the beam.",
            "Correct tool.array_axis, or the angle A of the taught tool.",
            partial(_quarter, setup=setup, sign=sign),
            of_laws=True,
        )


def place_hypotheses(setup: Setup) -> Iterator[Hypothesis]:
    """Yield other frames and units of the poses, and other units of the time of flight."""
    world = setup.T_world_base
    robroot = setup.robot_root.transform("world", "robroot")
    frames = {"world": world.inv(), "robroot": world.inv() @ robroot}
    for name, to_base in frames.items():
        step = Transform("base", "base", to_base.rigid)
        if np.linalg.norm(step.xyz_mm) < 1e-6 and float(step.angle_deg()) < 1e-6:
            continue
        yield Hypothesis(
            f"poses-in-{name}",
            f"the poses of the scan are in {name}, not in BASE.",
            "Export the poses in the BASE that was active, or give that BASE in the base_* columns.",
            partial(_moved, T=step),
        )
    for name, scale in LENGTH_SCALES:
        yield Hypothesis(
            "poses-unit",
            f"the positions of the scan are in {name}, not in mm.",
            f"Multiply x, y and z by {scale:g}.",
            partial(_scaled, setup=setup, scale=scale),
        )
    for name, scale in TIME_SCALES:
        yield Hypothesis(
            "tof-unit",
            f"the time of flight is in {name}, not in microseconds there and back.",
            f"Multiply it by {scale:g}.",
            partial(_slower, scale=scale),
        )
    yield Hypothesis(
        "beam-reversed",
        "the beams point away from the part.",
        "Correct tool.beam_axis (its sign), or the angles of the taught tool.",
        lambda c: replace(c, beams_base=None if c.beams_base is None else -c.beams_base),
    )


def _along(cloud: PointCloud, setup: Setup, turned: Callable[[Array, Array], Array]) -> PointCloud:
    """Return the cloud with the laws laid out along another axis through the same pose."""
    if cloud.arrays_base is None or cloud.beams_base is None:
        return cloud
    offsets = law_offsets_mm(setup.probe)
    x = offsets[cloud.law - 1][:, None]
    other = turned(cloud.arrays_base, cloud.beams_base)
    there = replace(cloud, origins_base=cloud.origins_base + x * (other - cloud.arrays_base), arrays_base=other)
    if not len(cloud.lost_law):
        return there
    # Where nothing came back the laws stand elsewhere too.
    array = pose_line(cloud, setup.probe).array_base[cloud.lost_pose_index]
    moved = offsets[cloud.lost_law - 1][:, None] * (turned(array, cloud.lost_beams_base) - array)
    return replace(there, lost_origins_base=cloud.lost_origins_base + moved)


def _quarter(cloud: PointCloud, setup: Setup, sign: float) -> PointCloud:
    return _along(cloud, setup, lambda a, b: sign * np.cross(b, a))


def _slower(cloud: PointCloud, scale: float) -> PointCloud:
    return replace(cloud, distance_mm=scale * cloud.distance_mm)


def _moved(cloud: PointCloud, T: Transform) -> PointCloud:
    turn = lambda v: None if v is None else T.directions(v)  # noqa: E731
    return replace(
        cloud,
        origins_base=T.points(cloud.origins_base),
        beams_base=turn(cloud.beams_base),
        arrays_base=turn(cloud.arrays_base),
    )


def _scaled(cloud: PointCloud, setup: Setup, scale: float) -> PointCloud:
    """Return the cloud with its poses, not the probe, scaled."""
    if cloud.arrays_base is None:
        return replace(cloud, origins_base=scale * cloud.origins_base)
    local = law_offsets_mm(setup.probe)[cloud.law - 1][:, None] * cloud.arrays_base
    return replace(cloud, origins_base=scale * (cloud.origins_base - local) + local)
