"""`simulate`: a part somewhere else than believed, a robot program, and the scan a real cell would have recorded."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alignment.scan import Scan
from alignment.simulator.beam import beam_sigma_mm, share_on_face, tilt_deg, tilt_loss_db
from alignment.simulator.disturb import actual_poses, bubbles, streams, wander
from alignment.simulator.fields import spring_back_field
from alignment.simulator.motion import ProgramMotion, firing_places
from alignment.simulator.shape import true_face
from alignment.simulator.truth import Field, Noise, Truth
from planner.couplant import sound_speed_m_s, water_speed_m_s
from planner.errors import fail
from planner.frames import Array, Transform
from planner.part import Part
from planner.placement import part_from_correction
from planner.probe import law_origins_tcp, tool_axes
from planner.program_path import ProgramPath
from planner.setup import Setup
from planner.surface.inspection import InspectionSurface

CHUNK = 400_000


@dataclass(frozen=True, eq=False)
class Echo:
    """n echoes before noise. distance_mm, amplitude_pct (n,): NaN and 0 where there is none."""

    distance_mm: Array
    amplitude_pct: Array


def simulate(
    part: Part,
    surface: InspectionSurface,
    program: ProgramPath,
    setup: Setup,
    truth: Truth,
    noise: Noise = Noise(),
    seed: int = 0,
    T_world_active: Transform | None = None,
) -> Scan:
    """Return the scan that the program takes of the true part.

    program: poses as read back from the exported KRL. T_world_active: the BASE it runs in (`T_world_basecorr` of a
    corrected program); None: the nominal one, and then the scan does not name it. The recorded pose is the commanded
    one; the actual one, from which the echo comes, differs by the pose noise and the latency. Same seed, same scan.
    """
    motion = ProgramMotion(program)
    s, pass_id, stretches = firing_places(program, motion, setup.inspection.point_spacing_mm)
    if len(s) == 0:
        raise fail("no-data-poses", "the program never switches data taking on.", "Export it with signals.data_output.")
    random = streams(seed)
    unit = wander(s, stretches, noise.correlation_mm, 6, random["pose"])
    recorded = motion.poses(s)
    T_base_active = Transform.identity("base", "base") if T_world_active is None else _in_base(setup, T_world_active)
    origins_tcp = law_origins_tcp(setup.probe)
    laws, m = len(origins_tcp), len(s)
    T_part_base = part_from_correction(truth.T_base_basecorr, setup.T_base_partnom).inv()
    fired = motion.seconds(s) + noise.latency_ms * 1e-3
    sweep = np.arange(laws) / noise.prf_hz if noise.prf_hz else np.zeros(laws)
    face = truth.surface if truth.surface is not None else None
    mesh = true_face(surface, _field(surface, truth.spring_back))
    distance, amplitude = np.full((m, laws), np.nan), np.zeros((m, laws))
    rows = max(1, CHUNK // laws)
    for begin in range(0, m, rows):
        part_of = slice(begin, min(m, begin + rows))
        if noise.prf_hz:
            moment = (fired[part_of, None] + sweep).ravel()
            chosen = np.repeat(unit[part_of], laws, axis=0)
            tcp = actual_poses(T_base_active @ motion.poses(motion.at_seconds(moment)), chosen, noise)
        else:
            tcp = actual_poses(T_base_active @ motion.poses(motion.at_seconds(fired[part_of])), unit[part_of], noise)
        Ts_part_tcp = T_part_base @ tcp @ tool_axes(setup.tool)
        rotation, xyz = Ts_part_tcp.rotation_matrix, Ts_part_tcp.xyz_mm
        n = part_of.stop - part_of.start
        each = (lambda v: v.reshape(n, laws, -1)) if noise.prf_hz else (lambda v: np.repeat(v[:, None], laws, axis=1))
        beams, arrays = each(rotation[:, :, 2]), each(rotation[:, :, 0])
        origins = each(xyz) + arrays * origins_tcp[:, None, 0].T[:, :, None] + beams * origins_tcp[None, :, 2, None]
        flat = [v.reshape(-1, 3) for v in (origins, beams, arrays)]
        echo = echoes(mesh, flat[0], flat[1], flat[2], setup, noise)
        distance[part_of] = echo.distance_mm.reshape(n, laws)
        amplitude[part_of] = echo.amplitude_pct.reshape(n, laws)
    del face
    return _record(
        setup, truth, noise, random, recorded, pass_id, motion.seconds(s), sweep, distance, amplitude, T_world_active
    )


def echoes(mesh, origins: Array, beams: Array, arrays: Array, setup: Setup, noise: Noise) -> Echo:
    """Return what each law hears: the perpendicular distance, and the amplitude left by tilt and by the rim."""
    closest, normals = mesh.foot(origins)
    distance = np.einsum("ij,ij->i", origins - closest, normals)
    feet = origins - distance[:, None] * normals
    b_deg, c_deg = tilt_deg(beams, arrays, normals)
    faces_probe = (np.hypot(b_deg, c_deg) < noise.lost_deg) & (distance > 0.0)
    aside = np.linalg.norm(feet - closest, axis=1)
    share = np.zeros(len(origins))
    sigma = beam_sigma_mm(setup.probe)
    near = np.flatnonzero(faces_probe)
    share[near] = share_on_face(feet[near], normals[near], aside[near] < 3.0 * sigma, mesh.rim_a, mesh.rim_b, sigma)
    loss = np.minimum(tilt_loss_db(b_deg, c_deg, setup.probe), noise.floor_db)
    amplitude = np.where(faces_probe, setup.reference_amplitude_pct * 10.0 ** (-loss / 20.0) * share, 0.0)
    heard = amplitude >= noise.detection_pct
    return Echo(np.where(heard, distance, np.nan), np.where(heard, amplitude, 0.0))


def _field(surface: InspectionSurface, spring_back: float | Field) -> Field | None:
    if callable(spring_back):
        return spring_back
    return spring_back_field(surface, "bend-twist", spring_back) if spring_back != 0.0 else None


def _in_base(setup: Setup, T_world_active: Transform) -> Transform:
    """Return `T_base_active`: the program's BASE seen from the nominal one (both named `base` by the program)."""
    return setup.T_world_base.inv() @ Transform("world", "base", T_world_active.rigid)


def _record(
    setup: Setup,
    truth: Truth,
    noise: Noise,
    random: dict[str, np.random.Generator],
    recorded: Transform,
    pass_id: NDArray[np.int32],
    t_pose: Array,
    sweep: Array,
    distance: Array,
    amplitude: Array,
    T_world_active: Transform | None,
) -> Scan:
    m, laws = distance.shape
    n = m * laws
    d, a = distance.ravel(), amplitude.ravel()
    heard = np.isfinite(d)
    d = d + noise.tof_mm * random["tof"].standard_normal(n)
    a = a * (1.0 + noise.amplitude * random["amplitude"].standard_normal(n))
    heard &= random["dropouts"].random(n) >= noise.dropouts
    d = np.where(heard, d, np.nan)
    d, a, _ = bubbles(d, a, noise, random["outliers"], setup.reference_amplitude_pct)
    speed = sound_speed_m_s(setup.couplant)
    if truth.temperature_error_c and setup.couplant.sound_speed_m_s is None:
        speed = water_speed_m_s(setup.couplant.temperature_c + truth.temperature_error_c)
    tof = 2.0 * d / (speed * 1e-3) + setup.couplant.delay_us
    a = np.where(np.isfinite(tof), np.maximum(a, 0.0), np.nan)
    return Scan(
        Ts_scan_tcp=Transform("scan", "tcp", recorded.rigid),
        pose_index=np.repeat(np.arange(m, dtype=np.int32), laws),
        law=np.tile(np.arange(1, laws + 1, dtype=np.int32), m),
        tof_us=tof,
        amplitude_pct=a,
        T_world_scan=None if T_world_active is None else Transform("world", "scan", T_world_active.rigid),
        t_s=(t_pose[:, None] + sweep).ravel(),
        pass_id=np.repeat(pass_id, laws),
        name="simulated",
    )
