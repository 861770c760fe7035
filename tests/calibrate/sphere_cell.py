"""A cell with a fixed sphere, traced law by law: what a probe at the end of a wrongly taught tool really sees."""

import numpy as np
from scipy.spatial.transform import Rotation

from alignment.scan import Scan
from planner.couplant import tof_us
from planner.frames import Transform
from planner.setup import Setup
from tests.calibrate.test_calibrate_tcp import LAWS, PITCH, true_tool

CENTRE = np.array([400.0, -120.0, 300.0])
# Echoes below this (%FSH) are lost in the noise of the receiver.
FAINTEST_PCT = 3.0


def record(
    setup: Setup,
    turn_deg,
    shift_mm,
    rng,
    *,
    radius=20.0,
    cone_deg=25.0,
    yaws=(0.0, 90.0),
    standoffs=(12.0, 18.0),
    half_mm=3.0,
    step_mm=1.5,
    pose_mm=0.03,
    correlation_mm=10.0,
    law_mm=0.01,
    amplitude_noise=0.02,
    loss=(2.0, 1.0),
    amplitude=True,
) -> Scan:
    """Return passes across the sphere from five directions, the tool turned about the beam and at several standoffs.

    Each pass goes along the tool's y and somewhere beside the middle of the array. The robot's error (and a sixth of the
    number in degrees about each axis) fades along a pass and is new on the next.
    """
    passes = []
    for tilt, around in [(0.0, 0.0), *((cone_deg, a) for a in (0.0, 90.0, 180.0, 270.0))]:
        view = Rotation.from_euler("ZY", [around, tilt], degrees=True)
        for yaw in yaws:
            facing = view * Rotation.from_euler("X", 180.0, degrees=True) * Rotation.from_euler("Z", yaw, degrees=True)
            for standoff in standoffs:
                along = np.arange(-half_mm, half_mm + 1e-9, step_mm)
                beside = np.column_stack([np.full(len(along), rng.uniform(-4, 4)), along, np.zeros(len(along))])
                passes.append((facing, CENTRE + view.apply([0, 0, radius + standoff]) + facing.apply(beside), along))
    at = np.vstack([p for _, p, _ in passes])
    facing = Rotation.concatenate([f for f, _, s in passes for _ in s])
    flange = Transform.from_parts("base", "tcp", facing, at) @ Transform(
        "tcp", "flange", true_tool(setup, [0, 0, 0], [0, 0, 0]).inv().rigid
    )
    real = flange @ true_tool(setup, turn_deg, shift_mm)
    wander = np.vstack([_wander(s, correlation_mm, rng) for _, _, s in passes])
    shaken = Rotation.from_rotvec(np.radians(pose_mm / 6.0) * wander[:, 3:]) * real.rotation
    origin, axes = real.xyz_mm + pose_mm * wander[:, :3], shaken.as_matrix()
    x = (np.arange(LAWS) - (LAWS - 1) / 2) * PITCH
    to_centre = CENTRE - origin[:, None] - x[None, :, None] * axes[:, None, :, 0]
    length = np.linalg.norm(to_centre, axis=2)
    seen = np.einsum("mki,mij->mkj", to_centre / length[..., None], axes)
    tilt_b, tilt_c = np.degrees(np.arcsin(seen[..., 0])), np.degrees(np.arcsin(seen[..., 1]))
    level = 50.0 * 10 ** (-(loss[0] * tilt_b**2 + loss[1] * tilt_c**2) / 20.0)
    level = level * (1.0 + amplitude_noise * rng.normal(size=level.shape))
    tof = tof_us((length - radius + law_mm * rng.normal(size=length.shape)).ravel(), setup.couplant)
    tof[level.ravel() < FAINTEST_PCT] = np.nan
    recorded = flange @ setup.tool.tcp.transform("flange", "tcp")
    return Scan(
        Transform("scan", "tcp", recorded.rigid),
        np.repeat(np.arange(len(at)), LAWS).astype(np.int32),
        np.tile(np.arange(1, LAWS + 1), len(at)).astype(np.int32),
        tof,
        level.ravel() if amplitude else np.full(level.size, np.nan),
        None,
    )


def _wander(s_mm, correlation_mm, rng):
    correlation = np.exp(-np.abs(s_mm[:, None] - s_mm[None]) / correlation_mm)
    return np.linalg.cholesky(correlation + 1e-12 * np.eye(len(s_mm))) @ rng.normal(size=(len(s_mm), 6))
