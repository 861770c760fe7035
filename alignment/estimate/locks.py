"""Locked axes that the readings contradict: a lock is the user's word, but not against what was measured."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from alignment.estimate.problem import Problem
from planner.frames import AXES, Array, Transform
from planner.issues import Issue
from planner.setup import Tolerances

# A lock is contradicted where chance alone would put the estimate so far off in one of so many scans, and where that is
# more than the tolerances call measured. An axis is named where it is this many standard deviations off by itself.
CHANCE = 1e-6
NAMED = 4.0
ANGLES = np.array([name in "abc" for name in AXES])


@dataclass(frozen=True, eq=False)
class LockStrain:
    """What the readings say of locked axes (k,), were they free: value and sigma off nominal, mm and deg.

    chance: of readings that say so although the lock is right.
    """

    axes: tuple[str, ...]
    value: Array
    sigma: Array
    chance: float


def lock_strain(problem: Problem, T_base_part: Transform, covariance: Array) -> LockStrain | None:
    """Return what the readings say of the locked axes; None without locks.

    T_base_part and covariance (6, 6), whitened by the prior: of the estimate with nothing held.
    """
    index = problem.locked
    if not index:
        return None
    unit = np.where(ANGLES, np.degrees(1.0), 1.0)[index]
    rows = problem.lock_rows(T_base_part) * unit[:, None]
    value = problem.T_base_basecorr(T_base_part).xyzabc[index]
    spread = rows @ covariance @ rows.T
    distance2 = float(value @ np.linalg.lstsq(spread, value, rcond=None)[0])
    return LockStrain(
        tuple(AXES[i] for i in index), value, np.sqrt(np.diag(spread)), float(chi2.sf(distance2, len(index)))
    )


def lock_issues(strain: LockStrain | None, converged: bool, tolerances: Tolerances) -> list[Issue]:
    """Return a warning where the readings contradict a lock, an error where they do by more than the inspection bears.

    Warning: beyond `position_mm` or `angle_deg`. Error: beyond `standoff_mm` or `tilt_deg`, or where nothing settles.
    """
    if strain is None or strain.chance > CHANCE:
        return []
    angle = np.array([name in "abc" for name in strain.axes])
    off = np.abs(strain.value)
    if not (off > np.where(angle, tolerances.angle_deg, tolerances.position_mm)).any():
        return []
    lost = not converged or bool((off > np.where(angle, tolerances.tilt_deg, tolerances.standoff_mm)).any())
    named = off > NAMED * strain.sigma
    if not named.any():
        named[:] = True
    said = ", ".join(
        f"{name} {v:+.3f} {'deg' if turns else 'mm'} (sigma {s:.3f})"
        for name, v, s, turns, yes in zip(strain.axes, strain.value, strain.sigma, angle, named, strict=True)
        if yes
    )
    names = ", ".join(name for name, yes in zip(strain.axes, named, strict=True) if yes)
    end = "" if converged else "; held there, no placement fits the readings"
    return [
        Issue(
            "error" if lost else "warning",
            "lock-contradicted",
            f"the readings contradict alignment.lock: they say {said}, the lock says 0{end}.",
            f"Take {names} out of alignment.lock, or find out why the part is not where the fixture should hold it.",
            "setup.json: alignment.lock",
        )
    ]
