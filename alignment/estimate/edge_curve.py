"""Where between two readings an edge lies: by the beam's own S-curve, which the scan itself shows.

A beam that moves off the part loses its echo on an S-curve, from a Gaussian's to a sharp disc's. Place and curve are those
under which the shares of the eight readings around each crossing are most likely. A share scatters in proportion to itself
and a little beside; now and then it is none of the edge's at all; and an echo that is not heard is either too weak or lost
by chance, as often as echoes are lost in the midst of the part. So one wrong reading moves nothing, and where the readings
happen to stand does not matter.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import minimize
from scipy.special import ndtr, ndtri

from alignment.estimate.edge_points import EdgePoints
from planner.frames import Array

# Full width at half maximum of a Gaussian, in standard deviations.
SIGMAS_PER_WIDTH = float(np.sqrt(8.0 * np.log(2.0)))
# Beams tried: from Gaussian (0) to a sharp disc (1), half to twice as wide as the set-up says; then finer.
BLENDS = np.array([0.2, 0.8])
WIDTHS = np.geomspace(0.5, 2.0, 9)
SIMPLEX = (0.2, 0.08, 0.5)
MOST_TRIALS = 60
# How far off the set-up's beam width may be, a logarithm.
WIDTH_DOUBT = 0.1
# So many crossings tell the shape of the beam well enough.
ENOUGH = 120
# With fewer readings the set-up is believed.
LEAST_READINGS = 20
# Where the edge may lie, from the reading on the part (0) to the one off it (1): lost echoes can make it another step's.
FIRST, LAST, STEP = -1.5, 2.5, 0.2
# Errors of the shares while the place is looked for: wide at first, so that it is found from afar.
LOOSE = (0.1, 0.05, 0.02, 0.0, 0.0, 0.0)
# An error of a share beyond this is a splash, not a shape; and how often readings are none of the edge's.
MOST_ERROR, STRAYS = 0.1, 0.01
# Scatter of the amplitude beside what is in proportion to it, as shares of the plateau; and least scatter in proportion.
FLOOR, FLOORS, LEAST_SCATTER = 0.005, (0.001, 0.03), 0.005
# How sharply echoes come to be heard, as a share of the least that is.
HEARING = 0.25
# Readings that tell the place worse than this (mm), and so many times worse than usual ones, tell nothing.
MOST_SIGMA_MM, MOST_SIGMAS = 0.12, 4.0
_REACH = np.arange(-3, 5)
_SHARES = np.clip(np.linspace(0.0, 1.0, 401), 1e-4, 1.0 - 1e-4)


@dataclass(frozen=True)
class Beam:
    """blend: 0 Gaussian, 1 disc. width_mm: between half amplitudes. floor: scatter of shares that is not in proportion."""

    blend: float
    width_mm: float
    floor: float = FLOOR


@dataclass(frozen=True, eq=False)
class Shares:
    """Shares (k, 8) around crossings, `gap_mm` (k,) apart across the edge.

    scatter, dropout: of the shares on the part, and how often an echo is lost there; least: the smallest share heard.
    """

    window: Array
    gap_mm: Array
    scatter: float
    dropout: float

    @property
    def least(self) -> float:
        """Return the smallest share at which echoes are heard at all, 0 where that is not seen."""
        heard = self.window[self.window > 0.0]
        return float(np.quantile(heard, 0.01)) if len(heard) else 0.0


@dataclass(frozen=True, eq=False)
class Places:
    """at (k,): place of the edge between the two middle readings. misfit (k,): mean squared error of the shares.

    information (k,): of the readings on `at`. value (k,): logarithm of the likelihood, the place integrated out.
    """

    at: Array
    misfit: Array
    information: Array
    value: Array


def locate(points: EdgePoints, cosine: Array, beam_width_mm: float) -> EdgePoints:
    """Return the crossings with their places found anew; cosine (k,): of the angle between their step and the conormal."""
    if len(points) == 0:
        return points
    gap = np.maximum(points.gap_mm * np.clip(cosine, 0.2, 1.0), 1e-9)
    near = Shares(points.window, gap, float(np.median(points.scatter)), float(np.median(points.dropout)))
    told = np.median(points.beam, axis=0)
    beam = fit_beam(near, beam_width_mm, None if np.isnan(told).any() else Beam(*told))
    found = place(near, beam)
    same = np.array_equal(points.window, points.window_other, equal_nan=True)
    sigma_mm = gap / np.sqrt(np.maximum(found.information, 1e-12))
    return replace(
        points,
        at=found.at,
        at_other=found.at if same else place(replace(near, window=points.window_other), beam, found.at).at,
        misfit=np.where(sigma_mm < max(MOST_SIGMA_MM, MOST_SIGMAS * float(np.median(sigma_mm))), found.misfit, np.inf),
        sigma_mm=sigma_mm,
        s_mm=points.s_mm + (found.at - points.at) * points.step_s_mm,
        beam=np.tile([beam.blend, beam.width_mm, beam.floor], (len(points), 1)),
    )


def fit_beam(near: Shares, beam_width_mm: float, known: Beam | None = None) -> Beam:
    """Return the beam whose S-curve explains the shares best; known: one that does so nearly."""
    if np.isfinite(near.window).sum() < LEAST_READINGS:
        return Beam(0.0, beam_width_mm)
    every = max(1, len(near.window) // ENOUGH)
    few = replace(near, window=near.window[::every], gap_mm=near.gap_mm[::every])

    def beam(v: Array) -> Beam:
        return Beam(float(v[0]), float(beam_width_mm * np.exp(v[1])), float(np.exp(v[2])))

    def cost(v: Array, start: Array | None) -> tuple[float, Array]:
        found = place(few, beam(v), start)
        return float(0.5 * (v[1] / WIDTH_DOUBT) ** 2 - found.value.sum()), found.at

    if known is None:
        tried = [(b, np.log(w), np.log(FLOOR)) for b in BLENDS for w in WIDTHS]
        (_, at), first = min(((cost(np.array(v), None), v) for v in tried), key=lambda pair: pair[0][0])
    else:
        first = (known.blend, np.log(known.width_mm / beam_width_mm), np.log(known.floor))
        _, at = cost(np.array(first), None)
    low, high = np.log(FLOORS)
    top = np.array([1.0, np.log(WIDTHS[-1]), high])
    steps = np.diag(SIMPLEX if known is None else 0.3 * np.array(SIMPLEX))
    simplex = np.vstack([first, first + np.where(first + steps > top, -1.0, 1.0) * steps])
    found = minimize(
        lambda v: cost(v, at)[0], first, method="Nelder-Mead", bounds=((0.0, 1.0), (np.log(WIDTHS[0]), top[1]), (low, high)),
        options={"xatol": 2e-3, "fatol": 0.05, "maxfev": MOST_TRIALS, "initial_simplex": simplex},
    )  # fmt: skip
    return beam(found.x)


def place(near: Shares, beam: Beam, start: Array | None = None) -> Places:
    """Return where the edges lie, by Fisher scoring; start (k,): where they are known to lie nearly."""
    curve = _Curve(near, beam)
    at, loose = (_sought(near, beam)[0], LOOSE) if start is None else (start, LOOSE[-3:])
    for wide in loose:
        e, rate = curve.at(at)
        pull, information, _ = curve.pull(e, rate, wide)
        move = np.divide(pull, information, out=np.zeros_like(pull), where=information > 1e-6)
        at = np.clip(at + np.clip(move, -0.3, 0.3), FIRST, LAST)
    e, rate = curve.at(at)
    _, information, value = curve.pull(e, rate, 0.0)
    return Places(at, curve.misfit(e), information, value - 0.5 * np.log(information + 1.0))


def _sought(near: Shares, beam: Beam) -> tuple[Array, Array]:
    """Return where among some places the edges fit best (k,), and how badly they fit there (k,)."""
    curve = _Curve(near, beam)
    tried = np.arange(FIRST, LAST + 1e-9, STEP)
    cost = np.stack([curve.loss(curve.at(np.full(len(near.window), t))[0]) for t in tried], axis=1)
    best = cost.argmin(axis=1)
    return tried[best], cost[np.arange(len(best)), best]


class _Curve:
    """The shares (k, 8) that a beam would have, and how likely those measured are under them."""

    def __init__(self, near: Shares, beam: Beam) -> None:
        self.depth, self.slope = _curve(beam.blend)
        self.scale = (near.gap_mm / beam.width_mm)[:, None]
        self.share, self.known = np.nan_to_num(near.window), np.isfinite(near.window)
        self.silent = self.known & (self.share <= 0.0)
        self.heard = self.known & ~self.silent
        self.least, self.dropout = near.least, near.dropout
        self.scatter, self.floor = max(near.scatter, LEAST_SCATTER), beam.floor

    def at(self, at: Array) -> tuple[Array, Array]:
        """Return the shares (k, 8) and what they change with the place, were the edges at (k,)."""
        inside = (at[:, None] - _REACH) * self.scale
        e = np.interp(inside, self.depth, _SHARES, left=0.0, right=1.0)
        return e, np.interp(inside, self.depth, self.slope, left=0.0, right=0.0) * self.scale

    def _silence(self, e: Array, wide: float) -> tuple[Array, Array]:
        """Return the probability (k, 8) of hearing nothing where e is expected, and its rate of change with e."""
        blur = np.hypot(max(HEARING * self.least, 1e-3), wide)
        z = (self.least - e) / blur
        weak = ndtr(z)
        lost = self.dropout + (1.0 - self.dropout) * weak
        return lost, -(1.0 - self.dropout) * np.exp(-0.5 * z**2) / (np.sqrt(2.0 * np.pi) * blur)

    def pull(self, e: Array, rate: Array, wide: float) -> tuple[Array, Array, Array]:
        """Return score, information and logarithm of the likelihood (k,) of the places; wide: added to the scatter."""
        variance = (self.scatter * e) ** 2 + self.floor**2 + wide**2
        error = self.share - e
        density = (1.0 - STRAYS) * np.exp(-0.5 * error**2 / variance) / np.sqrt(2.0 * np.pi * variance)
        own = np.where(self.heard, density / (density + STRAYS), 0.0)
        lost, falls = self._silence(e, wide)
        toward = np.where(self.silent, falls / lost, 0.0)
        pull = (own * rate * error / variance + rate * toward).sum(axis=1)
        information = (own * rate**2 / variance).sum(axis=1)
        likely = np.where(self.heard, np.log(density + STRAYS), np.where(self.silent, np.log(lost), 0.0)).sum(axis=1)
        return pull, information + ((rate * toward) ** 2).sum(axis=1), likely

    def loss(self, e: Array) -> Array:
        """Return how badly shares e (k, 8) fit, with a scatter that lets places be found from afar (k,)."""
        error = np.minimum(((self.share - e) / MOST_ERROR) ** 2, 9.0)
        silence = -np.log(self._silence(e, MOST_ERROR)[0])
        return np.asarray(np.where(self.heard, 0.5 * error, np.where(self.silent, silence, 0.0)).sum(axis=1))

    def misfit(self, e: Array) -> Array:
        """Return the mean squared error (k,) of the shares, silence counted as far as echoes are not lost by chance."""
        error = np.where(self.silent, np.maximum(e - self.least, 0.0), self.share - e)
        squared = np.minimum(error**2, MOST_ERROR**2)
        lost = self._silence(e, 0.0)[0]
        counts = np.where(self.heard, 1.0, np.where(self.silent, 1.0 - self.dropout / np.maximum(lost, 0.05), 0.0))
        counts = np.clip(counts, 0.0, 1.0)
        return np.asarray((counts * squared).sum(axis=1) / np.maximum(counts.sum(axis=1), 1.0))


_DISC_X = np.linspace(-1.0, 1.0, 401)
_DISC_SHARE = 0.5 + (np.arcsin(_DISC_X) + _DISC_X * np.sqrt(1.0 - _DISC_X**2)) / np.pi


@lru_cache(maxsize=256)
def _curve(blend: float) -> tuple[Array, Array]:
    """Return how deep inside the edge, in widths, a beam has each share of `_SHARES` (401,), and the curve's slope there."""
    gauss, disc = ndtri(_SHARES) / SIGMAS_PER_WIDTH, 0.5 * np.interp(_SHARES, _DISC_SHARE, _DISC_X)
    depth = (1.0 - blend) * gauss + blend * disc
    return depth, np.gradient(_SHARES, depth)
