"""`simulate`: a part somewhere else than believed, a robot program, and the scan a real cell would have recorded."""

import numpy as np

from alignment.scan import Scan
from alignment.simulator.body import TrueBody, true_body
from alignment.simulator.disturb import actual_poses, streams, wander
from alignment.simulator.echo import echoes
from alignment.simulator.fields import spring_back_field
from alignment.simulator.motion import ProgramMotion, firing_places
from alignment.simulator.record import record
from alignment.simulator.truth import Field, Noise, Truth
from planner.errors import fail
from planner.frames import Array, Transform
from planner.part import Part
from planner.placement import part_from_correction
from planner.probe import law_origins_tcp, tool_axes
from planner.program_path import ProgramPath
from planner.setup import Setup
from planner.surface.inspection import InspectionSurface

CHUNK = 400_000
"""Readings simulated at a time, to bound the memory."""
REFERENCE_NOISE = Noise()


def simulate(
    part: Part,
    surface: InspectionSurface,
    program: ProgramPath,
    setup: Setup,
    truth: Truth,
    noise: Noise = REFERENCE_NOISE,
    seed: int = 0,
    T_world_active: Transform | None = None,
    body: TrueBody | None = None,
) -> Scan:
    """Return the scan that the program takes of the true part.

    program: poses as read back from the exported KRL. T_world_active: the BASE it runs in (`T_world_basecorr` of a
    corrected program); None: the nominal one, and then the scan does not name it. The recorded pose is the commanded
    one; the actual one, from which the echo comes, differs by the pose noise and the latency. Same seed, same scan.
    body: what `true_shape(surface, truth)` returned, to build it once for many scans of one shape.
    """
    if surface.part is not part:
        raise ValueError("the inspection surface is not one of this part")
    motion = ProgramMotion(program)
    s, pass_id, stretches = firing_places(program, motion, setup.inspection.point_spacing_mm)
    if len(s) == 0:
        raise fail("no-data-poses", "the program never switches data taking on.", "Export it with signals.data_output.")
    random = streams(seed)
    unit = wander(s, stretches, noise.correlation_mm, 6, random["pose"])
    laws_tcp = law_origins_tcp(setup.probe)
    sweep_s = np.arange(len(laws_tcp)) / noise.prf_hz if noise.prf_hz else np.zeros(len(laws_tcp))
    T_part_active = part_from_correction(truth.T_base_basecorr, setup.T_base_partnom).inv() @ _active(
        setup, T_world_active
    )
    body = true_shape(surface, truth) if body is None else body
    t_pose = motion.seconds(s)
    fired_s = t_pose[:, None] + noise.latency_ms * 1e-3 + (sweep_s if noise.prf_hz else np.zeros(1))
    distance, amplitude = np.full((len(s), len(laws_tcp)), np.nan), np.zeros((len(s), len(laws_tcp)))
    step = max(1, CHUNK // len(laws_tcp))
    for begin in range(0, len(s), step):
        rows = slice(begin, min(len(s), begin + step))
        frames = _frames(motion, fired_s[rows], unit[rows], noise, T_part_active, setup)
        distance[rows], amplitude[rows] = echoes(body, *_beams(frames, fired_s[rows].shape, laws_tcp), setup, noise)
    times = t_pose[:, None] + sweep_s
    return record(distance, amplitude, motion.poses(s), pass_id, times, setup, truth, noise, random, T_world_active)


def true_shape(surface: InspectionSurface, truth: Truth) -> TrueBody:
    """Return the true part of a truth, in `part`: it depends on the spring-back, not on where the part is."""
    return true_body(surface, _field(surface, truth.spring_back), truth.surface)


def _frames(
    motion: ProgramMotion, fired_s: Array, unit: Array, noise: Noise, T_part_active: Transform, setup: Setup
) -> Transform:
    """Return `Ts_part_tcp` (EchoBase's TCP) of every firing moment (m, 1 or laws), in that order."""
    commanded = motion.poses(motion.at_seconds(fired_s.ravel()))
    actual = actual_poses(commanded, np.repeat(unit, fired_s.shape[1], axis=0), noise)
    return T_part_active @ actual @ tool_axes(setup.tool)


def _beams(Ts_part_tcp: Transform, moments: tuple[int, ...], laws_tcp: Array) -> tuple[Array, Array, Array]:
    """Return law origins, beams and array directions (m, laws, 3) in `part`; one frame a pose, or one a firing."""
    shape = (moments[0], len(laws_tcp), 3)
    rotation = Ts_part_tcp.rotation_matrix.reshape(*moments, 3, 3)
    xyz = Ts_part_tcp.xyz_mm.reshape(*moments, 3)
    array, beam = rotation[..., 0], rotation[..., 2]
    origins = xyz + laws_tcp[:, :1] * array + laws_tcp[:, 2:] * beam
    return origins, np.broadcast_to(beam, shape), np.broadcast_to(array, shape)


def _field(surface: InspectionSurface, spring_back: float | Field) -> Field | None:
    if callable(spring_back):
        return spring_back
    return spring_back_field(surface, "bend-twist", spring_back) if spring_back != 0.0 else None


def _active(setup: Setup, T_world_active: Transform | None) -> Transform:
    """Return the program's BASE seen from the nominal one; its poses call it `base` whatever it is."""
    if T_world_active is None:
        return Transform.identity("base", "base")
    return setup.T_world_base.inv() @ Transform("world", "base", T_world_active.rigid)
