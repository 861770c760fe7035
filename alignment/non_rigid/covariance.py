"""Covariance of nodes: a smooth field on the part, a rigid rest, a wandering robot, and single readings.

The field is a Gaussian process with the Matern kernel of smoothness 5/2 (C. E. Rasmussen, C. K. I. Williams, Gaussian
Processes for Machine Learning, 2006, eq. 4.17), differentiable, so that its slope is known with its own deviation. It has
one length along the part and another across it: beams bend one way. On a skin the distance in space is that along the
surface for all that matters.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alignment.estimate.noise_kernel import GAP, LENGTH, NUGGET, PATH, TILT
from alignment.non_rigid.nodes import Nodes, Track
from planner.frames import Array

ROOT5 = np.sqrt(5.0)
NAMES = ("nugget_mm", "path_mm", "path_length_mm", "gap_mm", "tilt_mm", "field_mm", "length_mm", "length_across_mm")
FIELD, ALONG, ACROSS = 5, 6, 7
# Order in which the noise model of the rigid step names the first five.
NOISE = (NUGGET, PATH, LENGTH, GAP, TILT)
STEP = 1e-4
# No node is believed to be better than this (mm): the laws of an array, tessellation and delays are not.
FLOOR_MM = 0.01


def matern(distance: Array) -> Array:
    """Return correlations at distances in lengths."""
    a = distance * ROOT5
    return np.asarray((1.0 + a + a * a / 3.0) * np.exp(-a))


def matern_slope(distance: Array) -> Array:
    """Return q with grad_u k(u, x) = -q (u - x), u and x in lengths."""
    a = distance * ROOT5
    return np.asarray((5.0 / 3.0) * (1.0 + a) * np.exp(-a))


def wander(track: Track, length_mm: float, gap_mm: float) -> Array:
    """Return the correlation (n, n) of means over stretches of an exponential process along the path.

    Means over stretches a and b, a gap d apart, of exp(-|s - t| / L): exp(-d / L) m(a) m(b), m(w) = (1 - exp(-w/L)) L/w, and
    of one with itself 2 (w/L - 1 + exp(-w/L)) (L/w)^2. Between passes the robot travels `gap_mm` on top.
    """
    a, b = track.from_mm, track.to_mm
    number = np.unique(track.pass_id, return_inverse=True)[1]
    apart = np.maximum(np.maximum(a[:, None] - b[None, :], a[None, :] - b[:, None]), 0.0)
    apart = apart + gap_mm * np.abs(number[:, None] - number[None, :])
    w = np.maximum((b - a) / length_mm, 1e-4)
    mean = -np.expm1(-w) / w
    c = np.exp(apart / -length_mm) * np.outer(mean, mean)
    np.fill_diagonal(c, 2.0 * (w + np.expm1(-w)) / w**2)
    return np.asarray(c[np.ix_(track.block, track.block)])


def surface_axes(points: Array) -> Array:
    """Return the axes (3, 3), columns, along which points (n, 3) extend most, second and least."""
    flat = points - points.mean(axis=0)
    return np.asarray(np.linalg.svd(flat, full_matrices=False)[2].T)


def scaling(axes: Array, log_lengths: Array) -> Array:
    """Return A (3, 3): p @ A has unit length scale. Logarithms of the lengths along the first two axes, mm; the third
    length is their geometric mean."""
    both = np.r_[log_lengths, log_lengths.mean()]
    return np.asarray(axes * np.exp(-both))


@dataclass(frozen=True, eq=False)
class NodeCovariance:
    """Covariances of the nodes for hyper-parameters theta (8,): logarithms of `NAMES`."""

    nodes: Nodes

    axes: Array

    @cached_property
    def _apart2(self) -> Array:
        """Squared distances of the nodes along each axis (3, n, n), mm2."""
        q = self.nodes.points_part @ self.axes
        return np.asarray((q.T[:, :, None] - q.T[:, None, :]) ** 2)

    @cached_property
    def rigid(self) -> Array:
        """Covariance (n, n) of what a rest of motion, as wide as the fixture's prior, makes of the nodes, mm2."""
        x = self.nodes.design
        return np.asarray(x @ x.T)

    def noise(self, theta: Array) -> tuple[Array, list[Array]]:
        """Return the covariance (n, n) of everything but the part, and its derivatives by the first five logarithms."""
        v, track = np.exp(theta), self.nodes.track
        nugget = v[0] ** 2 / self.nodes.count
        k = np.diag(nugget + FLOOR_MM**2)
        by = [np.diag(2.0 * nugget)]
        if not track.known:
            return k, by
        c = wander(track, v[2], v[3])
        longer = (wander(track, v[2] * np.exp(STEP), v[3]) - c) / STEP
        wider = (wander(track, v[2], v[3] * np.exp(STEP)) - c) / STEP
        # An error of the pose shows in two nodes alike as far as they look the same way.
        alike = v[1] ** 2 * self._alike
        across = v[4] ** 2 * np.outer(track.across, track.across)
        scale = alike + across
        by += [2.0 * alike * c, scale * longer, scale * wider, 2.0 * across * c]
        return k + scale * c, by

    @cached_property
    def _alike(self) -> Array:
        n = self.nodes.normals_part
        return np.asarray(n @ n.T)

    def field(self, theta: Array) -> tuple[Array, list[Array]]:
        """Return the covariance (n, n) of the field, and its derivatives by its three logarithms."""
        s2 = np.exp(2.0 * theta[FIELD])
        per = np.exp(-2.0 * np.r_[theta[ALONG], theta[ACROSS], 0.5 * (theta[ALONG] + theta[ACROSS])])
        u, v, w = self._apart2 * per[:, None, None]
        distance = np.sqrt(u + v + w)
        k, q = s2 * matern(distance), s2 * matern_slope(distance)
        return k, [2.0 * k, q * (u + 0.5 * w), q * (v + 0.5 * w)]
