"""A sprung-back part that exists only as formulas, scanned by `tests.alignment.clouds`, and what an inspection of it sees."""

from dataclasses import dataclass, replace

import numpy as np

from alignment.estimate.capture import capture
from alignment.estimate.directions import Direction
from alignment.estimate.problem import Problem
from alignment.non_rigid import fit_field
from planner.frames import Transform
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import ParamSurface, cylinder, plane

SETUP = Setup.model_validate({"placement": {"x_mm": 30, "y_mm": -20, "a_deg": 12}})
TRUTH = part_from_correction(
    Transform.from_xyzabc("base", "basecorr", (1.1, -0.7, 1.0, 0.2, -0.4, 0.3)), SETUP.T_base_partnom
)
STANDOFF_MM = 15.0
# All six directions as the rigid step would call them: measured.
MEASURED = tuple(
    Direction("measured", 0.01, np.eye(6)[k] * (np.radians(0.5) if k < 3 else 2.0), 0.01, 0.01) for k in range(6)
)


@dataclass(frozen=True)
class Part:
    """An analytic skin over u (mm) and v, and its smooth surface behind triangles."""

    surface: ParamSurface
    u: tuple[float, float]
    half_mm: float
    middle_mm: float

    def unit(self, p):
        """Coordinates -1..1 along and across."""
        return 2.0 * p[:, 0] / self.surface.u[1] - 1.0, (p[:, 1] - self.middle_mm) / self.half_mm


CYLINDER = Part(cylinder(400.0, 300.0, 200.0), (5.0, 295.0), 100.0, 0.0)
PLATE = Part(plane(300.0, 200.0), (5.0, 295.0), 100.0, 100.0)


def bend(p, part, a=1.5):
    return a * part.unit(p)[0] ** 2


def twist(p, part, a=1.5):
    x, y = part.unit(p)
    return a * x * y


def dent(p, part, a=1.5):
    x, y = part.unit(p)
    return -a * np.exp(-((x * 150 - 30) ** 2 + (y * part.half_mm) ** 2) / (2 * 40.0**2))


def step(p, part, a=1.5):
    return 0.5 * a * (1 + np.tanh(part.unit(p)[0] * 150 / 25.0))


def nothing(p, part, a=0.0):
    return 0.0 * p[:, 0]


def measured(part, field, seed=3, passes=4, reach=0.9, u=None, keep=None, directions=MEASURED, spacing_mm=3.0, **noise):
    """Scan the part, place it as a rigid one, fit the field: (fit, rigid placement, curved surface)."""
    low, high = part.surface.v
    v = 0.5 * (low + high) + 0.5 * (high - low) * np.linspace(-reach, reach, passes)
    curved = curved_of(part.surface)
    cloud = scan(
        part.surface, SETUP, TRUTH, np.random.default_rng(seed), u or part.u, v, spacing_mm=spacing_mm,
        field=lambda p: field(p, part), **noise,
    )  # fmt: skip
    if keep is not None:
        at = TRUTH.inv().points(cloud.axial_points_base)
        cloud = thinned(cloud, keep(at))
    rigid = capture(cloud, Problem(curved, SETUP)).T_base_part
    return fit_field(cloud, curved, SETUP, rigid, directions), rigid, curved


def thinned(cloud, rows):
    names = (
        "origins_base",
        "beams_base",
        "arrays_base",
        "distance_mm",
        "amplitude_pct",
        "law",
        "pose_index",
        "pass_id",
    )
    return replace(cloud, **{name: getattr(cloud, name)[rows] for name in (*names, "scan_id")})


@dataclass(frozen=True)
class Seen:
    """What the centre law of an inspection sees, pose by pose: error of the standoff (mm), tilts B, C and total (deg)."""

    off_mm: np.ndarray
    tilt_deg: np.ndarray
    loss_db: np.ndarray
    points: np.ndarray


def slope(surface, field, u, v):
    """Gradient of a field on points along the surface, by differences in the parameters."""
    h = 1e-4
    du, dv = surface.derivatives(u, v)
    fu = (field(surface.point(u + h, v)) - field(surface.point(u - h, v))) / (2 * h)
    fv = (field(surface.point(u, v + h)) - field(surface.point(u, v - h))) / (2 * h)
    a, b, c = (du * du).sum(1), (du * dv).sum(1), (dv * dv).sum(1)
    det = a * c - b * b
    return ((c * fu - b * fv) / det)[:, None] * du + ((a * fv - b * fu) / det)[:, None] * dv


def inspect(part, field, curved, T_found, found=None, share=0.95, n=(50, 30)):
    """Fly an inspection over the found part (rigid without `found`), and look at the true one from there."""
    low, high = part.surface.v
    half, middle = 0.5 * (high - low), 0.5 * (low + high)
    gu, gv = np.meshgrid(np.linspace(*part.u, n[0]), middle + half * share * np.linspace(-1, 1, n[1]))
    p = part.surface.point(gu.ravel(), gv.ravel())
    foot = curved.closest(p)
    f, g = (0.0 * p[:, 0], 0.0 * p) if found is None else found.on(foot.face, foot.bary)
    normal = foot.normals - g
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    tcp = foot.points + f[:, None] * foot.normals + STANDOFF_MM * normal
    to_true = TRUTH.inv() @ Transform("base", "part", T_found.rigid)
    tcp, beam = to_true.points(tcp), -to_true.directions(normal)
    surface = part.surface
    u, v = surface.foot(tcp)
    at, n_cad = surface.point(u, v), surface.normal(u, v)
    true = n_cad - slope(surface, lambda q: field(q, part), u, v)
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    height = ((tcp - at) * n_cad).sum(1) - field(at, part)
    secant = 1.0 / (true * n_cad).sum(1)
    distance = height - 0.5 * height * (secant**2 - 1.0)
    across = surface.derivatives(u, v)[1]
    array = across - (across * beam).sum(1, keepdims=True) * beam
    array /= np.linalg.norm(array, axis=1, keepdims=True)
    cos = -(true * beam).sum(1)
    b = np.degrees(np.arctan2((true * array).sum(1), cos))
    c = np.degrees(np.arctan2((true * np.cross(beam, array)).sum(1), cos))
    return Seen(distance - STANDOFF_MM, np.hypot(b, c), 2.0 * b**2 + c**2, p)


def spread(seen: Seen):
    return float(seen.off_mm.std()), float(np.ptp(seen.off_mm))
