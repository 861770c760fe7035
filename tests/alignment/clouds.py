"""Point clouds of analytic surfaces with known truth: exact feet, exact normals, nothing from `alignment.estimate`."""

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from alignment.cloud import PointCloud
from planner.frames import Transform
from planner.part import Part, Provenance
from planner.probe import law_offsets_mm
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.inspection import InspectionSurface
from tests.loop.surfaces import ParamSurface


def curved_of(surface: ParamSurface, nu: int = 31, nv: int = 21) -> CurvedSurface:
    vertices, faces = surface.mesh(nu, nv)
    part = Part(np.asarray(vertices, float), np.asarray(faces, np.int32), Provenance("analytic", "0", "mm"))
    return CurvedSurface(InspectionSurface(part, np.arange(len(faces), dtype=np.int32)), 4.5)


def lines(surface: ParamSurface, u_range, v_values, spacing_mm: float = 2.0):
    """Forth and back passes along u at each v: parameters and pass numbers."""
    out, passes = [], []
    for k, v in enumerate(v_values):
        fine = np.linspace(*u_range, 400)
        p = surface.point(fine, np.full_like(fine, v))
        s = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))]
        at = np.interp(np.arange(0.0, s[-1] + 1e-9, spacing_mm), s, fine)
        at = at[::-1] if k % 2 else at
        out.append(np.column_stack([at, np.full(len(at), v)]))
        passes.append(np.full(len(at), k))
    return np.concatenate(out), np.concatenate(passes)


def wander(rng, passes, spacing_mm, length_mm, columns=6, reset=False):
    rho = np.exp(-spacing_mm / length_mm)
    out = np.zeros((len(passes), columns))
    runs = [np.flatnonzero(passes == k) for k in np.unique(passes)] if reset else [np.arange(len(passes))]
    for run in runs:
        e = rng.standard_normal((len(run), columns)) * np.sqrt(1 - rho**2)
        e[0] = rng.standard_normal(columns)
        out[run] = lfilter([1.0], [1.0, -rho], e, axis=0)
    return out


def disc_share(surface, u, v, xa, ya, width_mm, points=600):
    """Share of a disc-shaped beam that falls on the part, by points in the disc.

    Each beam's points are turned by an angle of its own: what the points miss is not the same for neighbouring laws,
    which would move a whole crossing by a hundredth of a millimetre.
    """
    du, dv = surface.derivatives(u, v)
    a, b, c = (du * du).sum(1), (du * dv).sum(1), (dv * dv).sum(1)
    det = a * c - b * b

    def inside(rows, radius, angle):
        offset = radius * (np.cos(angle)[..., None] * xa[rows] + np.sin(angle)[..., None] * ya[rows])
        e, f = (offset * du[rows]).sum(1), (offset * dv[rows]).sum(1)
        step_u, step_v = (c[rows] * e - b[rows] * f) / det[rows], (a[rows] * f - b[rows] * e) / det[rows]
        return surface.inside(u[rows] + step_u, v[rows] + step_v)

    everywhere = np.arange(len(u))
    rim = sum(inside(everywhere, 0.55 * width_mm, np.array([t])).astype(int) for t in np.arange(8) * np.pi / 4)
    share = (rim == 8).astype(float)
    near = np.flatnonzero((rim > 0) & (rim < 8))
    turn = (near * 0.7548776662) % 1.0 * 2.0 * np.pi
    # Each point with its opposite, so that the half way point of the beam is its middle exactly.
    k = np.arange(points // 2)
    radius, angle = np.sqrt((k + 0.5) / len(k)) * width_mm / 2, k * 2.399963
    total = np.zeros(len(near))
    for r, t in zip(np.r_[radius, radius], np.r_[angle, angle + np.pi], strict=True):
        total += inside(near, r, t + turn)
    share[near] = total / (2 * len(k))
    return share


def scan(
    surface: ParamSurface, setup: Setup, T_base_part: Transform, rng, u_range, v_values, spacing_mm=2.0, pose_mm=0.03,
    pose_deg=0.005, correlation_mm=10.0, tof_mm=0.01, amplitude_noise=0.02, outliers=0.0, dropouts=0.0,
    reset=False, standoff_mm=15.0, field=None,
    true_setup=None, origin_map=None,
):  # fmt: skip
    """What a cell records: poses planned on the nominal surface, echoes of the true one at T_base_part."""
    uv, passes = lines(surface, u_range, v_values, spacing_mm)
    p, n = surface.point(*uv.T), surface.normal(*uv.T)
    across = surface.derivatives(*uv.T)[1]
    array = across - (across * n).sum(1, keepdims=True) * n
    array /= np.linalg.norm(array, axis=1, keepdims=True)
    R = np.stack([array, np.cross(-n, array), -n], axis=-1)
    nominal = setup.T_base_partnom
    R = nominal.rotation_matrix @ R
    tcp = (p + standoff_mm * n) @ nominal.rotation_matrix.T + nominal.xyz_mm
    noise = wander(rng, passes, spacing_mm, correlation_mm, reset=reset)
    R_true = Rotation.from_rotvec(np.radians(pose_deg) * noise[:, 3:]).as_matrix() @ R
    tcp_true = tcp + pose_mm * noise[:, :3]
    x, x_true = law_offsets_mm(setup.probe), law_offsets_mm((true_setup or setup).probe)
    m, laws = len(tcp), len(x)
    pose, law = np.repeat(np.arange(m), laws), np.tile(np.arange(laws), m)
    origin = tcp[pose] + x[law, None] * R[pose, :, 0]
    real = T_base_part.inv().points(tcp_true[pose] + x_true[law, None] * R_true[pose, :, 0])
    inv = T_base_part.rotation_matrix.T
    u, v = surface.foot(real)
    normal = surface.normal(u, v)
    d = ((real - surface.point(u, v)) * normal).sum(1)
    if field is not None:
        d = d - field(surface.point(u, v))
    axes = inv @ R_true[pose]
    cos = -(normal * axes[:, :, 2]).sum(1)
    b, c = (np.degrees(np.arctan2((normal * axes[:, :, k]).sum(1), cos)) for k in (0, 1))
    loss = np.minimum(2.0 * b**2 + c**2, 20.0)
    share = disc_share(surface, u, v, axes[:, :, 0], axes[:, :, 1], setup.probe.beam_width_mm)
    amplitude = 50.0 * 10 ** (-loss / 20) * share * (1 + amplitude_noise * rng.standard_normal(len(d)))
    d = d + tof_mm * rng.standard_normal(len(d))
    bad = (rng.random(len(d)) < outliers) & (amplitude >= 2.0)
    d = np.where(bad, standoff_mm * (0.2 + 1.8 * rng.random(len(d))), d)
    amplitude = np.where(bad, 50 * (0.1 + 0.9 * rng.random(len(d))), amplitude)
    heard = (amplitude >= 2.0) & (rng.random(len(d)) >= dropouts)
    lost = ~heard
    i32 = lambda a: a.astype(np.int32)  # noqa: E731
    beams, arrays = R[pose, :, 2], R[pose, :, 0]
    if origin_map is not None:
        origin, beams, arrays = origin_map.points(origin), origin_map.directions(beams), origin_map.directions(arrays)
    return PointCloud(
        origin[heard], beams[heard], arrays[heard], d[heard], amplitude[heard], i32(law[heard] + 1), i32(pose[heard]),
        i32(passes[pose[heard]]), i32(0 * pose[heard]), origin[lost], i32(pose[lost]), i32(law[lost] + 1), beams[lost],
        i32(passes[pose[lost]]), total_readings=len(d),
    )  # fmt: skip


def normal_error_mm(surface: ParamSurface, T_true: Transform, T_found: Transform, n: int = 40) -> float:
    gu, gv = np.meshgrid(np.linspace(*surface.u, n), np.linspace(*surface.v, n))
    p, nn = surface.point(gu.ravel(), gv.ravel()), surface.normal(gu.ravel(), gv.ravel())
    return float(np.abs(((T_found.points(p) - T_true.points(p)) * T_true.directions(nn)).sum(1)).max())
