"""Two files, one scan: poses logged by the robot and echoes logged by the acquisition, merged by time."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from planner.errors import fail
from planner.frames import Transform
from planner.issues import Issue

# A pose interval longer than this many usual ones is a gap: nothing is interpolated across it.
GAP_CYCLES = 5.0


def merge_by_time(poses: dict[str, Any], echoes: dict[str, Any], where: str) -> tuple[dict[str, Any], Transform]:
    """Return a `readings` payload without its poses, and `Ts_scan_tcp` at the distinct times of the echoes.

    Positions are interpolated linearly, orientations by slerp (never Euler angles). Nothing is extrapolated: echoes
    outside the pose log, or within a gap of it, are left out and counted in the issues.
    """
    t_pose, first = np.unique(poses["t_s"], return_index=True)
    if len(t_pose) < 2:
        raise fail("poses-too-few", "the pose log has fewer than two times.", "Log a pose every few ms.", where)
    six = poses["poses"][first]
    t_echo = echoes["t_s"]
    inside = (t_echo >= t_pose[0]) & (t_echo <= t_pose[-1])
    if not inside.any():
        raise fail(
            "times-do-not-meet",
            f"the echoes run from {t_echo[0]:g} to {t_echo[-1]:g} s, the poses from {t_pose[0]:g} to {t_pose[-1]:g} s.",
            "Both files need the same clock; shift one of them by the known offset.",
            where,
        )
    step = np.diff(t_pose)
    usual = float(np.median(step))
    interval = np.clip(np.searchsorted(t_pose, t_echo, side="right") - 1, 0, len(step) - 1)
    gap = (
        inside & (step[interval] > GAP_CYCLES * usual) & (t_echo != t_pose[interval]) & (t_echo != t_pose[interval + 1])
    )
    keep = inside & ~gap
    issues = _issues(int((~inside).sum()), int(gap.sum()), len(t_echo), usual, step, where)
    if not keep.any():
        raise fail("times-do-not-meet", "all echoes fall into gaps of the pose log.", "Log poses without gaps.", where)
    t_kept = t_echo[keep]
    times, pose_index = np.unique(t_kept, return_inverse=True)
    stack = interpolate(t_pose, six, times)
    passes = _passes(poses, first, echoes, keep, interval)
    out = {key: echoes[key][keep] for key in ("law", "tof_us", "amplitude_pct")}
    out |= {"kind": "readings", "t_s": t_kept, "pose_index": pose_index.astype(np.int32), "pass_id": passes}
    out |= {"base": poses["base"], "issues": [*poses["issues"], *echoes["issues"], *(i.to_json() for i in issues)]}
    out["simulated"] = any(half.get("simulated", False) for half in (poses, echoes))
    return out, stack


def interpolate(t_pose: np.ndarray, six: np.ndarray, times: np.ndarray) -> Transform:
    """Return `Ts_scan_tcp` at `times`, between poses (m, 6) at strictly rising times: lerp and slerp."""
    xyz = np.stack([np.interp(times, t_pose, six[:, i]) for i in range(3)], axis=1)
    turns = Slerp(t_pose, Rotation.from_euler("ZYX", six[:, 3:], degrees=True))
    return Transform.from_parts("scan", "tcp", turns(times), xyz)


def _passes(
    poses: dict[str, Any], first: np.ndarray, echoes: dict[str, Any], keep: np.ndarray, interval: np.ndarray
) -> np.ndarray | None:
    if echoes["pass_id"] is not None:
        return echoes["pass_id"][keep]
    return None if poses["pass_id"] is None else poses["pass_id"][first][interval[keep]]


def _issues(outside: int, in_gap: int, total: int, usual: float, step: np.ndarray, where: str) -> list[Issue]:
    issues = []
    if outside:
        issues.append(
            Issue(
                "warning",
                "echoes-outside-poses",
                f"{outside} of {total} echoes lie before the first or after the last pose and were left out.",
                "Start the pose log before the acquisition and stop it after.",
                where,
            )
        )
    if in_gap:
        issues.append(
            Issue(
                "warning",
                "pose-gap",
                f"{in_gap} of {total} echoes fall into gaps of the pose log (up to {step.max():.3g} s, usually {usual:.3g} s).",
                "They were left out; look for lost packets in the pose log.",
                where,
            )
        )
    return issues
