"""May scans of several plans be aligned together? One part, in one believed place, by one probe; else one clear sentence."""

from collections.abc import Sequence

import numpy as np

from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.issues import Issue
from planner.setup import Setup

# Numbers written by one person and copied by another agree to this (mm, deg).
SAME_MM, SAME_DEG = 1e-3, 1e-4


def require_one_part(names: Sequence[str], sha256: Sequence[str]) -> None:
    """Raise EchoBaseError `parts-differ` unless all plans are of the same CAD file."""
    issues = [
        Issue(
            "error",
            "parts-differ",
            f"'{name}' is not a plan of the same CAD file as '{names[0]}' (SHA-256 {sha[:12] or 'unknown'}, not "
            f"{sha256[0][:12] or 'unknown'}).",
            "Plan every surface from the same file of the part, then scan and align.",
            name,
        )
        for name, sha in zip(names, sha256, strict=True)
        if sha != sha256[0]
    ]
    if issues:
        raise EchoBaseError(*issues)


def bases_in_first(names: Sequence[str], setups: Sequence[Setup]) -> list[Transform]:
    """Return for each plan its base as seen from the first plan's; raise EchoBaseError where the plans contradict.

    BASEs may differ, as long as both are taught and every plan believes the part in the same place in the world. The
    fixture's tolerance, the probe and the locked axes must be the same.
    """
    issues: list[Issue] = []
    first = setups[0]
    for name, setup in zip(names[1:], setups[1:], strict=True):
        issues += [*_same_place(names[0], first, name, setup), *_same_cell(names[0], first, name, setup)]
    if issues:
        raise EchoBaseError(*issues)
    world = first.T_world_base.inv()
    return [world @ Transform("world", "base", s.T_world_base.rigid) for s in setups]


def _same_place(first_name: str, first: Setup, name: str, setup: Setup) -> list[Issue]:
    if first.base.is_taught != setup.base.is_taught or (
        not first.base.is_taught and first.base.number != setup.base.number
    ):
        said = [f"BASE {s.base.number} {'taught' if s.base.is_taught else 'untaught'}" for s in (first, setup)]
        return [
            Issue(
                "error",
                "bases-unrelated",
                f"'{first_name}' is planned in {said[0]}, '{name}' in {said[1]}: where one stands as seen from the other is "
                "not known.",
                "Plan both in the same BASE, or state the numbers of both in their setups (base).",
                name,
            )
        ]
    place, other = (s.T_world_base @ s.T_base_partnom for s in (first, setup))
    off = place.rigid.inv() * other.rigid
    shift, turn = float(np.linalg.norm(off.translation)), float(np.degrees(off.rotation.magnitude()))
    if shift <= SAME_MM and turn <= SAME_DEG:
        return []
    return [
        Issue(
            "error",
            "places-differ",
            f"'{first_name}' and '{name}' believe the part in different places: {shift:.3f} mm and {turn:.4f} deg apart "
            "(base and placement).",
            "Give both plans the same base and placement, then plan again.",
            name,
        )
    ]


def _same_cell(first_name: str, first: Setup, name: str, setup: Setup) -> list[Issue]:
    pairs = [
        ("fixture", first.fixture, setup.fixture),
        ("probe", first.probe, setup.probe),
        ("alignment.lock", sorted(set(first.alignment.lock)), sorted(set(setup.alignment.lock))),
    ]
    if first.alignment.lock:
        pairs.append(("base", first.base.xyzabc(), setup.base.xyzabc()))
    differ = [field for field, a, b in pairs if a != b]
    if not differ:
        return []
    return [
        Issue(
            "error",
            "setups-differ",
            f"the setups of '{first_name}' and '{name}' differ in {' and '.join(differ)}: scans that are aligned together "
            "share one fixture and one probe.",
            "Make them equal and plan again.",
            name,
        )
    ]
