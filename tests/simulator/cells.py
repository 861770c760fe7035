"""Parts with a known formula, and programs over them, for tests of the simulated scanner."""

from collections.abc import Callable

import numpy as np
import trimesh

from planner.frames import Array, Transform
from planner.part import Part, Provenance
from planner.program_path import Motion, ProgramPath
from planner.surface.inspection import InspectionSurface

NO_OFFSET = Transform.identity("base", "basecorr")


def part_of(vertices: Array, faces: Array) -> Part:
    return Part(np.asarray(vertices, float), np.asarray(faces, np.int32), Provenance("test", "0" * 64, "mm"))


def plate(x: float = 150.0, y: float = 100.0, z: float = 10.0) -> tuple[Part, InspectionSurface]:
    """A box centred on the origin; its top face is inspected."""
    mesh = trimesh.creation.box((x, y, z))
    part = part_of(mesh.vertices, mesh.faces)
    return part, InspectionSurface(part, np.flatnonzero(part.face_normals[:, 2] > 0.9).astype(np.int32))


def sheet(
    point: Callable[[Array, Array], Array], nu: int, nv: int, u: Array, v: Array, jitter: float = 0.0, seed: int = 0
) -> tuple[Part, InspectionSurface]:
    """An open triangulated sheet point(u, v), outward where du x dv points; inner vertices moved by `jitter` of a cell."""
    uu, vv = np.meshgrid(np.linspace(*u, nu), np.linspace(*v, nv), indexing="ij")
    random = np.random.default_rng(seed)
    inner = (slice(1, -1), slice(1, -1))
    uu[inner] += jitter * (u[1] - u[0]) / (nu - 1) * random.uniform(-1, 1, uu[inner].shape)
    vv[inner] += jitter * (v[1] - v[0]) / (nv - 1) * random.uniform(-1, 1, vv[inner].shape)
    i = np.arange(nu * nv).reshape(nu, nv)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    part = part_of(point(uu.ravel(), vv.ravel()), faces)
    return part, InspectionSurface(part, np.arange(len(faces), dtype=np.int32))


def looking_down(xyz: Array, travel: Array) -> Transform:
    """TCP poses at xyz (n, 3) with the beam along -z and the array across the travel direction (3,)."""
    n = len(xyz)
    beam = np.tile([0.0, 0.0, -1.0], (n, 1))
    array = np.cross(travel, [0.0, 0.0, -1.0])
    array = np.tile(array / np.linalg.norm(array), (n, 1))
    return Transform.from_axes("base", "tcp", array, np.cross(beam, array), beam, xyz)


def program(
    poses: Transform,
    data_on: Array,
    pass_id: Array | None = None,
    speed_mm_s: float = 100.0,
    block: Array | None = None,
) -> ProgramPath:
    """LIN motions through the poses, or splines where `block` is not negative."""
    n = len(poses)
    blocks = np.full(n, -1) if block is None else np.asarray(block)
    return ProgramPath(
        Ts_base_tcp=poses,
        motion=np.where(blocks >= 0, Motion.SPL, Motion.LIN).astype(np.uint8),
        block=blocks.astype(np.int32),
        data_on=np.asarray(data_on, dtype=bool),
        speed_mm_s=np.full(n, speed_mm_s),
        pass_id=(np.zeros(n) if pass_id is None else np.asarray(pass_id)).astype(np.int32),
    )


def one_pass(start: Array, stop: Array, speed_mm_s: float = 100.0) -> ProgramPath:
    """One straight pass looking down."""
    start, stop = np.asarray(start, float), np.asarray(stop, float)
    return program(looking_down(np.stack([start, stop]), stop - start), [False, True], speed_mm_s=speed_mm_s)
