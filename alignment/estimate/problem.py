"""What every step of the estimate shares: surface, prior and the nominal placement, with the centre of motions."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alignment.estimate.motion import area_moments, motion_between, moved, named_axes
from planner.frames import AXES, Array, Transform
from planner.placement import assume_nominal, correction
from planner.setup import Setup
from planner.surface.curved import CurvedSurface


@dataclass(frozen=True, eq=False)
class Problem:
    """The part on its nominal placement, and how far the fixture lets it stray."""

    curved: CurvedSurface
    setup: Setup

    @cached_property
    def T_base_nominal(self) -> Transform:
        """`T_base_part` where the program believes the part is."""
        return assume_nominal(self.setup.T_base_partnom)

    @cached_property
    def nominal_centre_mm(self) -> Array:
        """Area centroid of the inspection surface on its nominal placement, `base`, mm."""
        return self.T_base_nominal.points(self.curved.surface.centroid_part)

    @cached_property
    def prior_sigma(self) -> Array:
        """Standard deviations of xi (6,): rad and mm, axes of base, about the centroid."""
        fixture = self.setup.fixture
        return np.repeat([np.radians(fixture.sigma_deg), fixture.sigma_mm], 3)

    def centre_mm(self, T_base_part: Transform) -> Array:
        """Return the area centroid moved with the part, `base`, mm."""
        return T_base_part.points(self.curved.surface.centroid_part)

    def total(self, T_base_part: Transform) -> Array:
        """Return the motion (6,) from the nominal placement, about the nominal centroid, in prior standard deviations."""
        return motion_between(self.T_base_nominal, T_base_part, self.nominal_centre_mm) / self.prior_sigma

    def step(self, T_base_part: Transform, z: Array) -> Transform:
        """Return the placement after a further motion z (6,), in prior standard deviations, about its centroid."""
        return moved(T_base_part, z * self.prior_sigma, self.centre_mm(T_base_part))

    @cached_property
    def half_size_mm(self) -> float:
        """Half the largest extent of the surface (mm)."""
        return 0.5 * float(self.curved.surface.extents_mm.max())

    def moves_mm(self, z: Array) -> float:
        """Return about how far (mm) a motion z (6,), in prior standard deviations, moves the surface."""
        xi = z * self.prior_sigma
        return float(np.linalg.norm(xi[3:]) + self.half_size_mm * np.linalg.norm(xi[:3]))

    def moments_base(self, T_base_part: Transform) -> Array:
        """Return the second area moments (3, 3) of the surface about its centroid, axes of base, mm2."""
        r = T_base_part.rotation_matrix
        return r @ self.moments_part @ r.T

    @cached_property
    def moments_part(self) -> Array:
        """The second area moments (3, 3) of the surface about its centroid, axes of part, mm2."""
        s = self.curved.surface
        return area_moments(s.vertices, s.faces, s.face_areas_mm2)

    def T_base_basecorr(self, T_base_part: Transform) -> Transform:
        """Return the correction people read."""
        return correction(T_base_part, self.setup.T_base_partnom)

    def axes_of(self, T_base_part: Transform) -> Array:
        """Return M (6, 6): (x, y, z, a, b, c) (mm, rad) of the correction per motion in prior standard deviations."""
        m = named_axes(self.T_base_basecorr(T_base_part), self.centre_mm(T_base_part))
        return m * self.prior_sigma

    @property
    def locked(self) -> list[int]:
        """Numbers of the axes x, y, z, a, b, c that the user locks."""
        return [AXES.index(name) for name in dict.fromkeys(self.setup.alignment.lock)]

    def lock_rows(self, T_base_part: Transform) -> Array:
        """Return the rows (k, 6) of `axes_of` that the user locks."""
        return self.axes_of(T_base_part)[self.locked]

    def off_nominal(self, T_base_part: Transform, held: Array) -> Array:
        """Return how far off nominal held directions (6, h) stand (h,): for locked axes, which come first, exactly."""
        values = held.T @ self.total(T_base_part)
        index = self.locked
        if index and held.shape[1]:
            found = self.T_base_basecorr(T_base_part).xyzabc
            six = np.r_[found[:3], np.radians(found[3:])][index]
            rows = self.lock_rows(T_base_part)
            m = int(np.linalg.matrix_rank(rows))
            values[:m] = np.linalg.lstsq(rows @ held[:, :m], six)[0]
        return values
