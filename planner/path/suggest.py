"""Key points suggested: on strips that cover what was asked and tell most about where the part is."""

from dataclasses import replace

import numpy as np

from planner.errors import EchoBaseError, fail
from planner.frames import Array
from planner.keypoint import KeyPoint
from planner.path.alignment import expect_sensible, passes_through
from planner.path.axes import ScanAxes, raster_axes
from planner.path.bands import band_passes
from planner.path.coverage import swept_share
from planner.path.crossings import PATCH_MM, PATCH_SIGMA_MM, prior_precision, rows
from planner.path.ends import EDGE_REACH_MM
from planner.path.mesh import PathMesh
from planner.path.places import ALONG_INSET, APART, EDGE_ROOM, Strip, places
from planner.path.sampling import sample_equal_area
from planner.path.section import positions, whole_lines
from planner.path.tour import strip_id
from planner.setup import Setup
from planner.surface.curved import CurvedSurface

_SHARES = (0.35, 0.5, 0.65)
_CLOSE_ENOUGH = 0.01
_ROUNDS = 8
_POINTS_WANTED = 12
# Strips that lie along the very rim join nothing: tried again with this much less of them.
_NUDGE = 0.97
# Another than along, or the points of crossing strips would meet near the corners.
_ACROSS_INSET = 1.8


def suggest(curved: CurvedSurface, setup: Setup, seed: int = 0) -> tuple[KeyPoint, ...]:
    """Return key points, on strips along and across the surface, whose alignment path covers `alignment.coverage` of it.

    Strips run from the edges inwards, spread over the surface; of several divisions between along and across the one with
    the smallest predicted largest normal error is taken (fixture prior, independent patches of surface). Points keep
    their search radius from edges and avoid curved places. The same input gives the same points; another `seed` shifts
    the strips a little. Ids say strip and place (`S3.1`); `alignment_path` relies on them.
    """
    mesh = PathMesh.of(curved.surface)
    axes = raster_axes(curved, setup)
    asked = setup.alignment.coverage
    width = band_passes(curved, setup) * setup.probe.swath_mm
    length = asked * curved.surface.area_mm2 / width
    expect_sensible(asked * curved.surface.area_mm2 / setup.probe.swath_mm, setup)
    shift = float(np.random.default_rng(seed).uniform(-0.2, 0.2)) if seed else 0.0
    ranked = []
    for share in _SHARES:
        strips = _strips(mesh, axes, share, length, width, setup, shift)
        if strips:
            ranked.append((_largest_error(curved, mesh, strips, setup), share))
    if not ranked:
        raise fail(
            "suggest-no-room", "The surface is too small for key points.", "Give a smaller alignment.search_radius_mm."
        )
    share = min(ranked)[1]
    best: tuple[float, tuple[KeyPoint, ...]] = (np.inf, ())
    tried: list[tuple[float, float]] = []
    for _ in range(_ROUNDS):
        strips = _strips(mesh, axes, share, length, width, setup, shift)
        points = _keypoints(curved, mesh, strips, setup) if strips else ()
        got = _covered(curved, points, setup)
        if got is None:
            length *= _NUDGE
            continue
        if points:
            tried.append((length, got))
            if abs(got - asked) < best[0]:
                best = (abs(got - asked), points)
            if best[0] <= _CLOSE_ENOUGH:
                break
        length = _next_length(tried, length, asked)
    if not best[1]:
        raise fail(
            "suggest-no-room", "The surface is too small for key points.", "Give a smaller alignment.search_radius_mm."
        )
    return best[1]


def _covered(curved: CurvedSurface, points: tuple[KeyPoint, ...], setup: Setup) -> float | None:
    """Return the share that the passes through key points cover; None where no line joins two of them."""
    if not points:
        return 0.0
    try:
        return swept_share(curved, passes_through(curved, points, setup), setup)
    except EchoBaseError as error:
        if error.issues[0].code == "section-missing":
            return None
        raise


def _next_length(tried: list[tuple[float, float]], length: float, asked: float) -> float:
    """Return the strip length to try next: between the nearest below and above, or in proportion."""
    below = [t for t in tried if t[1] <= asked]
    above = [t for t in tried if t[1] > asked]
    if below and above:
        (l0, c0), (l1, c1) = max(below, key=lambda t: t[1]), min(above, key=lambda t: t[1])
        f = np.clip((asked - c0) / max(c1 - c0, 1e-9), 0.15, 0.85)
        return float(l0 + f * (l1 - l0))
    return length * float(np.clip(asked / max(tried[-1][1], 1e-3), 0.5, 2.0)) if tried else length * 1.5


def _strips(
    mesh: PathMesh, axes: ScanAxes, share: float, length: float, width: float, setup: Setup, shift: float
) -> list[Strip]:
    """Return strips of about this total length, `share` of it along the surface, the rest across."""
    out: list[Strip] = []
    for side, part, inset in ((axes.across, share, ALONG_INSET), (axes.along, 1.0 - share, _ACROSS_INSET)):
        out += [replace(s, inset=inset) for s in _family(mesh, side, part * length, width, setup, shift)]
    return out


def _family(mesh: PathMesh, side: Array, length: float, width: float, setup: Setup, shift: float) -> list[Strip]:
    used = (mesh.vertices @ side)[mesh.faces]
    lo, hi = float(used.min()), float(used.max())
    probe = whole_lines(mesh, side, lo + (hi - lo) * np.linspace(0.15, 0.85, 7))
    # Round a loop a strip goes less than half way, so that its two ends say which way.
    usable = [0.45 * s.length if s.loop else s.length for s in probe]
    typical = float(np.median(usable))
    # Two points apart from each other and off the edge.
    least = min(1.1 * (EDGE_ROOM + APART) * setup.alignment.search_radius_mm, 0.75 * typical)
    count = int(np.ceil(length / typical - 0.05))
    if count < 2:
        count = 2 if length / 2.0 >= least else 1
    part = min(max(length / count, least) / typical, 1.0)
    inset = 0.5 / count
    if count <= 3:
        inset = min(inset, 0.2)
    off = max(0.6 * width, 1.1 * setup.alignment.search_radius_mm)
    inset = min(max(inset, off / max(hi - lo, 1e-9)), 0.45)
    at = np.linspace(inset, 1.0 - inset, count) if count > 1 else np.array([0.5])
    at = np.clip(at + shift * (at[1] - at[0] if count > 1 else 0.5), 0.5 * inset, 1.0 - 0.5 * inset)
    out = []
    for i, stroke in enumerate(whole_lines(mesh, side, lo + (hi - lo) * at)):
        span = part * stroke.length * (0.45 if stroke.loop else 1.0)
        if stroke.loop:
            start = 0.5 * stroke.length * (i % 2)
            out.append(Strip(stroke, start, start + span, (False, False)))
        elif part > 0.95 or stroke.length - span < min(EDGE_REACH_MM, stroke.length / 3.0):
            out.append(Strip(stroke, 0.0, stroke.length, (True, True)))
        elif i % 2 == 0:
            out.append(Strip(stroke, 0.0, span, (True, False)))
        else:
            out.append(Strip(stroke, stroke.length - span, stroke.length, (False, True)))
    return out


def _largest_error(curved: CurvedSurface, mesh: PathMesh, strips: list[Strip], setup: Setup) -> float:
    """Return the largest normal error over the surface (mm, one sigma) predicted for a scan of these strips."""
    centre = curved.surface.centroid_part
    precision = prior_precision(setup)
    for strip in strips:
        _, bary, face = positions(mesh, strip.stroke.line, np.arange(strip.s0, strip.s1, PATCH_MM))
        p, n = curved.evaluate(face.astype(np.int32), bary)
        j = rows(p, n, centre) / PATCH_SIGMA_MM
        precision = precision + j.T @ j
    s = sample_equal_area(curved.surface.face_areas_mm2, 500)
    p, n = curved.evaluate(s.face, s.bary)
    g = rows(p, n, centre)
    return float(np.round(np.sqrt(np.einsum("ni,ij,nj->n", g, np.linalg.inv(precision), g).max()), 9))


def _keypoints(curved: CurvedSurface, mesh: PathMesh, strips: list[Strip], setup: Setup) -> tuple[KeyPoint, ...]:
    each = int(np.clip(np.ceil(_POINTS_WANTED / len(strips)), 2, 4))
    return tuple(
        KeyPoint(id=strip_id(number, i), x_mm=float(p[0]), y_mm=float(p[1]), z_mm=float(p[2]))
        for number, points in enumerate(places(curved, mesh, strips, each, setup), start=1)
        for i, p in enumerate(points, start=1)
    )
