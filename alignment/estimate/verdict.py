"""May the robot trust it? Pass, partial or fail, each with its reason and what to do."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from alignment.estimate.directions import Direction
from alignment.estimate.motion import moved
from planner.frames import Array, Transform
from planner.issues import Issue, errors_in
from planner.placement import assume_nominal
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.toolpath import ToolPath

MOST_POSES = 4000
# A direction is judged by this many of its standard deviations.
SIGMAS = 2.0
# What the operator must accept, by parts of the issues' codes.
PARTIAL = ("not-rigid", "harmful", "lock-contradicted", "off-edges")


def limit_issues(centroid_shift_mm: float, turn_deg: float, setup: Setup) -> list[Issue]:
    """Return errors where the correction exceeds the limits: they refuse, never clamp."""
    limits, out = setup.limits, []
    if centroid_shift_mm > limits.correction_mm:
        out.append(
            Issue(
                "error",
                "limit-displacement",
                f"the part's centroid would move by {centroid_shift_mm:.2f} mm, more than the limit of "
                f"{limits.correction_mm:g} mm.",
                "Check that the right part lies in the fixture, or raise limits.correction_mm if such a move is meant.",
            )
        )
    if turn_deg > limits.correction_deg:
        out.append(
            Issue(
                "error",
                "limit-rotation",
                f"the part would turn by {turn_deg:.3f} deg, more than the limit of {limits.correction_deg:g} deg.",
                "Check how the part lies in the fixture, or raise limits.correction_deg if such a turn is meant.",
            )
        )
    return out


def residual_issues(rms_mm: float, setup: Setup) -> list[Issue]:
    """Return an error or a warning where the readings do not fit a rigid part."""
    t = setup.tolerances
    if rms_mm > t.standoff_mm:
        return [
            Issue(
                "error",
                "residual-large",
                f"the readings stand {rms_mm:.2f} mm rms off the placed part, beyond tolerances.standoff_mm "
                f"({t.standoff_mm:g} mm).",
                "Check part, unit and scan; if the part has sprung back this far, run the alignment as non-rigid.",
            )
        ]
    if rms_mm > 3.0 * t.position_mm:
        return [
            Issue(
                "warning",
                "not-rigid",
                f"the readings stand {rms_mm:.2f} mm rms off the placed part, beyond three times "
                f"tolerances.position_mm ({t.position_mm:g} mm): the part differs from its CAD.",
                "Run the alignment as non-rigid to follow its shape.",
            )
        ]
    return []


def harm_of(
    direction: Direction,
    curved: CurvedSurface,
    path: ToolPath,
    setup: Setup,
    centre_mm: Array,
    T_base_part: Transform,
) -> str | None:
    """Return what a motion of two sigmas along a direction would do to the inspection, or None if it is harmless.

    The corrected program meets a part that lies two sigmas off: every data pose must keep tilt and standoff within
    tolerances (as far as it kept them before), and no point may slide along the surface by more than `edge_margin_mm`.
    """
    data = path.take(path.is_data)
    if len(data) == 0:
        return None
    data = data.take(np.unique(np.linspace(0, len(data) - 1, min(len(data), MOST_POSES)).astype(np.intp)))
    # In the corrected base the program's poses lie on the estimated part: in `part` they are the path's own.
    tcp = data.Ts_part_tcp
    before = _tilt_and_standoff(curved, tcp, setup)
    tolerances = setup.tolerances
    contact, normal = data.Ts_part_contact.xyz_mm, data.Ts_part_contact.rotation_matrix[:, :, 2]
    at, facing = T_base_part.points(contact), T_base_part.directions(normal)
    worst: dict[str, float] = {}
    for sign in (SIGMAS, -SIGMAS):
        xi = sign * direction.sigma * direction.vector
        T_moved = moved(T_base_part, xi, centre_mm)
        step = T_moved.points(contact) - at
        slide = step - np.einsum("ij,ij->i", step, facing)[:, None] * facing
        worst["slide"] = max(worst.get("slide", 0.0), float(np.linalg.norm(slide, axis=1).max()))
        seen = Transform("part", "part", (T_moved.inv().rigid * T_base_part.rigid)) @ tcp
        tilt, standoff, on = _tilt_and_standoff(curved, seen, setup)
        judged = on & before[2]
        over_tilt = judged & (tilt > tolerances.tilt_deg) & (before[0] <= tolerances.tilt_deg)
        off = np.abs(standoff - data.standoff_mm)
        over_off = (
            judged & (off > tolerances.standoff_mm) & (np.abs(before[1] - data.standoff_mm) <= tolerances.standoff_mm)
        )
        if over_tilt.any():
            worst["tilt"] = max(worst.get("tilt", 0.0), float(tilt[over_tilt].max()))
        if over_off.any():
            worst["standoff"] = max(worst.get("standoff", 0.0), float(off[over_off].max()))
    if "tilt" in worst:
        return f"tilts a pose by {worst['tilt']:.2f} deg (tolerance {tolerances.tilt_deg:g} deg)"
    if "standoff" in worst:
        return f"puts a pose {worst['standoff']:.2f} mm off its standoff (tolerance {tolerances.standoff_mm:g} mm)"
    margin = setup.inspection.edge_margin_mm
    if worst["slide"] > margin:
        return f"slides a point {worst['slide']:.2f} mm along the surface (edge margin {margin:g} mm)"
    return None


def _tilt_and_standoff(
    curved: CurvedSurface, Ts_part_tcp: Transform, setup: Setup
) -> tuple[Array, Array, NDArray[np.bool_]]:
    foot = curved.closest(Ts_part_tcp.xyz_mm)
    beam = Ts_part_tcp.rotation_matrix[:, :, 2]
    cosine = -np.einsum("ij,ij->i", beam, foot.normals)
    sine = np.linalg.norm(np.cross(beam, foot.normals), axis=1)
    return np.degrees(np.arctan2(sine, cosine)), foot.distance_mm, foot.interior


def direction_issues(
    directions: Sequence[Direction],
    curved: CurvedSurface,
    path: ToolPath | None,
    setup: Setup,
    centre_mm: Array,
    T_base_part: Transform,
) -> list[Issue]:
    """Return one issue per held or weak direction: a warning if it may harm the inspection, else information."""
    out = []
    for d in directions:
        if d.status == "measured":
            continue
        if d.locked:
            out.append(
                Issue(
                    "info", "direction-locked", f"{describe(d)} is locked at its nominal value.", "", "alignment.lock"
                )
            )
            continue
        harm = None if path is None else harm_of(d, curved, path, setup, centre_mm, T_base_part)
        what = (
            "cannot be told from this scan and is held at its nominal value"
            if d.status == "held"
            else (
                f"is known only to {d.displacement_mm:.3f} mm rms and {d.turn_deg:.3f} deg (one sigma), and was applied"
            )
        )
        if harm is None:
            out.append(
                Issue("info", f"direction-{d.status}", f"{describe(d)} {what}; it does not matter to the inspection.")
            )
        else:
            out.append(
                Issue(
                    "warning",
                    f"direction-{d.status}-harmful",
                    f"{describe(d)} {what}; two sigmas of it {harm}.",
                    "Let the alignment scan cross free edges, add key points where the surface curves or turns, or lock it "
                    "if the fixture defines it.",
                )
            )
    return out


def describe(d: Direction) -> str:
    """Return a direction in words: what it moves most, in base."""
    turn, slide = np.degrees(d.vector[:3]), d.vector[3:]
    words = []
    if np.linalg.norm(slide) > 0.05:
        words.append("a shift along " + _axis_words(slide))
    if np.linalg.norm(turn) > 0.02:
        words.append("a turn about " + _axis_words(turn))
    return " with ".join(words) if words else "a motion"


def _axis_words(v: Array) -> str:
    unit = v / np.linalg.norm(v)
    k = int(np.argmax(np.abs(unit)))
    if abs(unit[k]) > 0.97:
        return "xyz"[k]
    return "({:.2f}, {:.2f}, {:.2f})".format(*(unit * np.sign(unit[k])))


def verdict_of(issues: Sequence[Issue], partial_codes: Sequence[str] = PARTIAL) -> str:
    """Return fail on any error, partial on what the operator must accept, else pass."""
    if errors_in(issues):
        return "fail"
    return "partial" if any(code in i.code for i in issues for code in partial_codes) else "pass"


def nominal_shift(setup: Setup, T_base_part: Transform, centroid_part: Array) -> tuple[float, float]:
    """Return how far (mm) the centroid moves from its nominal place, and the total turn (deg)."""
    T_nominal = assume_nominal(setup.T_base_partnom)
    shift = T_base_part.points(centroid_part) - T_nominal.points(centroid_part)
    return float(np.linalg.norm(shift)), float((T_base_part @ T_nominal.inv()).angle_deg())
