"""Three faces of a block at right angles, as analytic surfaces, each planned by itself."""

import numpy as np

from alignment.estimate.several import SurfaceScan
from planner.frames import Transform
from planner.path.raster import raster
from planner.placement import part_from_correction
from planner.setup import Setup
from tests.alignment.clouds import curved_of, scan
from tests.loop.surfaces import ParamSurface

LENGTH, WIDTH, HEIGHT = 220.0, 140.0, 90.0
TOP = ParamSurface(lambda u, v: np.stack([u, v, 0 * u], 1), (0.0, LENGTH), (0.0, WIDTH))
SIDE = ParamSurface(lambda u, v: np.stack([u, 0 * u, v], 1), (0.0, LENGTH), (-HEIGHT, 0.0))
END = ParamSurface(lambda u, v: np.stack([0 * u, v, u], 1), (-HEIGHT, 0.0), (0.0, WIDTH))
FACES = {"top": TOP, "side": SIDE, "end": END}
CURVED = {name: curved_of(face) for name, face in FACES.items()}
INSIDE = {
    "top": ((10, LENGTH - 10), np.linspace(25.0, WIDTH - 25.0, 4)),
    "side": ((10, LENGTH - 10), np.linspace(-HEIGHT + 25.0, -25.0, 3)),
    "end": ((-HEIGHT + 10, -10), np.linspace(25.0, WIDTH - 25.0, 4)),
}
ACROSS = {
    "top": ((-8, LENGTH + 8), np.linspace(5.0, WIDTH - 5.0, 5)),
    "side": ((-8, LENGTH + 8), np.linspace(-HEIGHT + 5.0, -5.0, 4)),
    "end": ((-HEIGHT - 8, 8), np.linspace(5.0, WIDTH - 5.0, 5)),
}
CELL = {
    "base": {"x_mm": 1000, "y_mm": 200, "z_mm": 300, "a_deg": 40, "number": 2},
    "placement": {"x_mm": 30, "y_mm": -20, "z_mm": 10, "a_deg": 12},
}
SETUP = Setup.model_validate(CELL)


def truth(offset, setup=SETUP):
    return part_from_correction(Transform.from_xyzabc("base", "basecorr", offset), setup.T_base_partnom)


def scanned(name, T_base_part, rng, setup=SETUP, lines=INSIDE, path=False, **noise):
    """The scan of one face, with the plan it was taken by."""
    cloud = scan(FACES[name], setup, T_base_part, rng, *lines[name], **noise)
    return SurfaceScan(name, cloud, CURVED[name], (), setup, raster(CURVED[name], setup) if path else None)
