"""A line drawn on the surface that the passes follow."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from planner.errors import EchoBaseError, fail
from planner.frames import Array
from planner.surface.curved import CurvedSurface

# Points of the line nearer to each other than this (mm) are one.
_SAME_MM = 0.01
# A section through two points whose normals differ by more than this (cosine) still holds both; a longer line is laid out
# flat, which a surface that turns further away does not allow.
_FLAT_COSINE = 0.2
# The curve through more than two points is followed in this many pieces.
_PIECES = 100


@dataclass(frozen=True, eq=False)
class Guide:
    """A line laid out in the plane about `origin` square to `normal` (3,): line (k, 2), along, across (3,); `part`, mm."""

    origin: Array
    along: Array
    across: Array
    normal: Array
    line: Array

    def height_mm(self, points: Array) -> Array:
        """Return the signed distance (n,), mm, of points (n, 3) from the line seen along `normal`, positive on its left.

        Beyond its ends the line goes on straight.
        """
        d = points - self.origin
        p = np.stack([d @ self.along, d @ self.across], axis=1)
        best = np.full(len(p), np.inf)
        out = np.zeros(len(p))
        last = len(self.line) - 2
        for i, (a, b) in enumerate(zip(self.line[:-1], self.line[1:], strict=True)):
            u = (b - a) / np.linalg.norm(b - a)
            off = p - a
            t = off @ u
            # Rays at both ends.
            t = np.clip(t, -np.inf if i == 0 else 0.0, np.inf if i == last else float(np.linalg.norm(b - a)))
            away = np.linalg.norm(off - t[:, None] * u, axis=1)
            side = u[0] * off[:, 1] - u[1] * off[:, 0]
            # At a corner both pieces are equally near: the one seen more from its side says which side it is.
            nearer = (away < best - 1e-9) | ((away < best + 1e-9) & (np.abs(side) > np.abs(out)))
            best = np.where(nearer, away, best)
            out = np.where(nearer, side, out)
        return np.where(out < 0.0, -best, best)


def guide_through(curved: CurvedSurface, points: Array, normal: Array, turn_deg: float) -> Guide:
    """Return the guide through points (k >= 2, 3) put on the surface, turned about its middle and the normal.

    Two points: the plane through them and the normals there, on any surface. More: a smooth curve seen along the mean `normal`
    (3,), for surfaces that face that way all over. Raises EchoBaseError `guide-degenerate`.
    """
    foot = curved.closest(points)
    at = foot.points
    keep = np.concatenate([[True], np.linalg.norm(np.diff(at, axis=0), axis=1) > _SAME_MM])
    at, normals = at[keep], foot.normals[keep]
    if len(at) == 2:
        normal = normals.sum(axis=0)
    chord = at[-1] - at[0]
    normal = normal / max(float(np.linalg.norm(normal)), 1e-12)
    along = chord - (chord @ normal) * normal
    length = float(np.linalg.norm(along))
    if len(at) < 2 or length < _SAME_MM or not np.isfinite(length):
        raise _degenerate("The line drawn for the passes has no length on the surface.")
    if len(at) > 2 and float((curved.surface.face_normals @ normal).min()) < _FLAT_COSINE:
        raise _degenerate("A line of more than two points cannot guide passes on a surface that turns away from it.")
    along = along / length
    across = np.cross(normal, along)
    origin = at.mean(axis=0)
    line = np.stack([(at - origin) @ along, (at - origin) @ across], axis=1)
    turn = np.radians(turn_deg)
    along, across = np.cos(turn) * along + np.sin(turn) * across, np.cos(turn) * across - np.sin(turn) * along
    pieces = np.linalg.norm(np.diff(line, axis=0), axis=1)
    line = line[np.concatenate([[True], pieces >= _SAME_MM])]
    return Guide(origin, along, across, normal, _smooth(line))


def _smooth(line: Array) -> Array:
    """Return points (m, 2) on the natural cubic spline through a line (k, 2): passes that follow it turn gradually."""
    if len(line) == 2:
        return line
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    return np.asarray(CubicSpline(s, line, bc_type="natural")(np.linspace(0.0, s[-1], _PIECES + 1)))


def _degenerate(message: str) -> EchoBaseError:
    return fail(
        "guide-degenerate",
        message,
        "Draw it from one side of the surface to the other.",
        "setup.json: inspection.guide",
    )
