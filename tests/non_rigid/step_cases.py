"""Parts with a step steeper than any path, scanned and planned: what an alignment says, and what its inspection then sees."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from alignment.estimate.align import align
from app.plan import Plan
from app.steps.non_rigid import Followed, follow
from planner.frames import Transform
from planner.path.raster import raster
from planner.placement import assume_nominal
from planner.setup import Setup
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import ParamSurface, plane, wing
from tests.non_rigid.cases import TRUTH

CELL = Setup.model_validate({"placement": {"x_mm": 30, "y_mm": -20, "a_deg": 12}, "inspection": {"strategy": "plane"}})
PARTS = {
    "plate": plane(300.0, 200.0),
    "wing": wing(length=300.0, chord=200.0, twist_deg=4.0, camber=12.0),
}


@cache
def plan_of(name: str) -> Plan:
    """An inspection of the part, without key points."""
    curved = curved_of(PARTS[name], 61, 41)
    path = raster(curved, CELL)
    return Plan(curved.surface.part, curved.surface, CELL, (), path, path, {}).with_curved(curved)


def ramp(height, width, at, direction):
    """A step of `height` (mm) that rises over `width` (mm) at `at` along a direction of the plane x, y."""
    n = np.array(direction, float) / np.linalg.norm(direction)
    return lambda p: height * np.clip((p[:, :2] @ n - at) / width + 0.5, 0.0, 1.0)


def flat(p):
    return 0.0 * p[:, 0]


def cloud_of(name, field, seed, passes=4, reach=0.9, u=(5.0, 295.0), spacing_mm=2.0, **noise):
    """A scan of `passes` passes along the part."""
    low, high = PARTS[name].v
    v = 0.5 * (low + high) + 0.5 * (high - low) * np.linspace(-reach, reach, passes)
    rng = np.random.default_rng(seed)
    return scan(PARTS[name], CELL, TRUTH, rng, u, v, spacing_mm=spacing_mm, field=field, **noise)


@dataclass(frozen=True)
class Told:
    """What the alignment said and what its inspection sees: spread and range of the standoff, mm."""

    followed: Followed
    std_mm: float
    range_mm: float

    def issue(self, code):
        return next((i for i in self.followed.found.issues if i.code == code), None)


def told(name, field, seed, non_rigid=True, u=(-15.0, 315.0), **scanned) -> Told:
    plan = plan_of(name)
    cloud = cloud_of(name, field, seed, u=u, **scanned)
    rigid = align(cloud, plan.curved, [], CELL, plan.inspection, "map", None, non_rigid)
    followed = follow(plan, cloud, rigid, non_rigid)
    return Told(followed, *seen(PARTS[name], field, followed))


def seen(surface: ParamSurface, field, followed: Followed):
    """Fly the corrected program, and look at the true part from there."""
    Ts = assume_nominal(CELL.T_base_partnom) @ followed.dense.take(followed.dense.is_data).Ts_part_tcp
    part = Transform("base", "part", (followed.found.T_base_basecorr.inv() @ TRUTH).rigid)
    tcp = (part.inv() @ Ts).xyz_mm
    u, v = surface.foot(tcp)
    at = surface.point(u, v)
    height = (((tcp - at) * surface.normal(u, v)).sum(axis=1) - field(at))[surface.inside(u, v)]
    return float(height.std()), float(np.ptp(height))
