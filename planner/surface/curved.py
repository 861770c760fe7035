"""`CurvedSurface`: the smooth surface behind the triangles of an inspection surface."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.setup import Probe
from planner.surface.closest import Foot
from planner.surface.inspection import InspectionSurface
from planner.surface.nearest import Triangles
from planner.surface.normals import unit
from planner.surface.patch import CurvedTriangles
from planner.surface.rays import Scene
from planner.surface.solid import solid_of
from planner.surface.topology import Edges, edges_of
from planner.surface.vertex_fit import VertexFit, fit_vertices

# Share of the area whose worst triangle gives the angle error.
COVERED = 0.9999
FOOT_STEPS = 6
FOOT_TOLERANCE_MM = 1e-5
# Triangles a step along a fine mesh may cross before the nearest one is asked for instead.
WALK = 12
SLICE = 16_384


def footprint_mm(probe: Probe) -> float:
    """Return the radius over which the probe averages the surface (mm): half the larger of beam, aperture and elevation.

    The paper's cell (15 elements of 0.6 mm, 9 mm elevation): 4.5 mm.
    """
    return 0.5 * max(probe.beam_width_mm, probe.aperture_elements * probe.pitch_mm, probe.elevation_mm)


class CurvedSurface:
    """The smooth surface behind the triangles: cubic in position and quadratic in normal inside each of them.

    The vertices of a CAD tessellation lie on the true surface; a local polynomial over the footprint gives normal and
    curvature there, and curved point-normal triangles carry them over the faces. All arguments and results are in `part`,
    mm; faces are rows of `surface.faces`, barycentrics (n, 3). Planar regions stay exactly planar.
    """

    def __init__(self, surface: InspectionSurface, footprint_mm: float) -> None:
        self.surface = surface
        self.footprint_mm = float(footprint_mm)
        self._faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
        self._vertices = np.ascontiguousarray(surface.vertices)
        self._welded = surface.welded
        count = int(self._welded.max()) + 1
        positions = np.zeros((count, 3))
        positions[self._welded] = self._vertices
        self._welded_faces = self._welded[self._faces]
        fit = fit_vertices(positions, self._welded_faces, self.footprint_mm)
        w = self._welded
        points = self._vertices if fit.exact else fit.points[w]
        self.vertex_fit = VertexFit(points, fit.normals[w], fit.shape[w], fit.exact)

    @cached_property
    def triangles(self) -> Triangles:
        """The triangles, ready to be asked which is nearest."""
        part, own = self.surface.part, len(self._vertices) != len(self.surface.part.vertices)
        # Where the surface is the whole part, the checks for collisions have the same tree.
        own |= len(self._faces) != len(part.faces)
        return Triangles(self._vertices, self._faces, boxes=None if own else lambda: solid_of(part).tree)

    def get_ready(self) -> None:
        """Work out beforehand what the first question about a foot would have to wait for."""
        _ = self._at_rim

    @cached_property
    def _edges(self) -> Edges:
        return edges_of(self._welded_faces)

    @cached_property
    def _at_rim(self) -> NDArray[np.bool_]:
        """Welded vertices on the boundary (w,)."""
        edges = self._edges
        on = np.zeros(int(self._welded.max()) + 1, dtype=bool)
        on[edges.vertices[edges.is_boundary].ravel()] = True
        return on

    @cached_property
    def _patches(self) -> CurvedTriangles:
        return CurvedTriangles(self.vertex_fit.points, self.vertex_fit.normals)

    def evaluate(self, face: NDArray, bary: Array) -> tuple[Array, Array]:
        """Return points (n, 3) and unit outward normals (n, 3) at barycentrics of faces."""
        points, normals = self._patches.points_and_normals(self._faces[face], bary)
        return points, normals if self.vertex_fit.exact else self._blended(face, bary)

    def normals(self, face: NDArray, bary: Array) -> Array:
        """Return unit outward normals (n, 3)."""
        return self._patches.normals(self._faces[face], bary) if self.vertex_fit.exact else self._blended(face, bary)

    def _blended(self, face: NDArray, bary: Array) -> Array:
        """Return normals inside triangles; between vertices that scatter, what these say about slopes is only noise."""
        return unit(np.einsum("nk,nkj->nj", bary, self.vertex_fit.normals[self._faces[face]]))

    def shape_operator(self, face: NDArray, bary: Array) -> Array:
        """Return symmetric W (n, 3, 3), 1/mm, with dn = W dp for steps along the surface; a sphere has +1/R."""
        return self._shape(face, bary, self.normals(face, bary))

    def _shape(self, face: NDArray, bary: Array, normal: Array) -> Array:
        blended = np.einsum("nk,nkij->nij", bary, self.vertex_fit.shape[self._faces[face]])
        into = np.einsum("nij,nj->ni", blended, normal)
        twice = np.einsum("ni,ni->n", into, normal)
        mixed = np.einsum("ni,nj->nij", normal, into - 0.5 * twice[:, None] * normal)
        return np.asarray(blended - mixed - mixed.transpose(0, 2, 1))

    def closest(self, points_part: Array) -> Foot:
        """Return the feet of points (n, 3): closest on the triangles, then moved until the offset is along the normal."""
        query = np.ascontiguousarray(points_part, dtype=np.float64).reshape(-1, 3)
        near = self.triangles.nearest(query)
        return self.foot_from(query, near.face, near.bary)[0]

    def foot_from(self, query: Array, face: NDArray[np.int32], bary: Array) -> tuple[Foot, NDArray[np.bool_]]:
        """Return the feet of points (n, 3) that steps from places on faces lead to, and which steps died out (n,)."""
        face, bary = face.copy(), bary.copy()
        points, normals = self.evaluate(face, bary)
        active = np.arange(len(query))
        for _ in range(FOOT_STEPS):
            step = self._foot_step(query[active], face[active], bary[active], points[active], normals[active])
            far = np.einsum("ij,ij->i", step, step) > FOOT_TOLERANCE_MM**2
            active, step = active[far], step[far]
            if not len(active):
                break
            # Most steps stay inside their triangle; only those that leave it need a search. The curved point stands beside
            # the flat one of the same barycentrics, so it is the step that is taken over, not where it leads.
            bary[active] += self.triangles.barycentric_step(face[active], step)
            left = active[(bary[active] < 0.0).any(axis=1)]
            face[left], bary[left] = self._onto(face[left], bary[left])
            points[active], normals[active] = self.evaluate(face[active], bary[active])
        settled = np.ones(len(query), dtype=bool)
        settled[active] = False
        return self._foot(query, face, bary, points, normals), settled

    def _onto(self, face: NDArray[np.int32], bary: Array) -> tuple[NDArray[np.int32], Array]:
        """Return the faces and barycentrics of places in the planes of faces (n,), outside of them."""
        face, bary = face.copy(), bary.copy()
        at = np.einsum("nk,nkj->nj", bary, self._vertices[self._faces[face]])
        lost = self._walk(at, face, bary) if self.triangles.is_fine else np.ones(len(at), dtype=bool)
        if lost.any():
            near = self.triangles.nearest(at[lost])
            face[lost], bary[lost] = near.face, near.bary
        return face, bary

    def _walk(self, at: Array, face: NDArray[np.int32], bary: Array) -> NDArray[np.bool_]:
        """Walk in place to the faces that points (n, 3) stand over, across one edge at a time; return who met a rim (n,).

        A point of the surface is nearest to the triangle it stands over, but for another sheet within the chord error.
        """
        lost = np.zeros(len(at), dtype=bool)
        walking = np.arange(len(at))
        for _ in range(WALK):
            walking = walking[(bary[walking] < 0.0).any(axis=1)]
            if not len(walking):
                return lost
            onward = self._beyond(face[walking], np.argmin(bary[walking], axis=1))
            lost[walking[onward < 0]] = True
            walking, onward = walking[onward >= 0], onward[onward >= 0]
            face[walking] = onward
            bary[walking] = self.triangles.barycentric(onward, at[walking])
        lost[walking[(bary[walking] < 0.0).any(axis=1)]] = True
        return lost

    def _beyond(self, face: NDArray, k: NDArray) -> NDArray[np.int64]:
        """Return the faces on the other side of faces' edges opposite corners k (n,); -1 where there is none, or two."""
        edges = self._edges
        edge = edges.of_face[face, k]
        return np.where(edges.uses[edge] == 2, edges.first[edge] + edges.second[edge] - face, -1)

    def _foot_step(self, query: Array, face: NDArray, bary: Array, points: Array, normals: Array) -> Array:
        """Return the Newton step (n, 3) along the surface that makes query - foot parallel to the normal."""
        offset = query - points
        height = np.einsum("ij,ij->i", offset, normals)
        along = offset - height[:, None] * normals
        turned = height[:, None, None] * self._shape(face, bary, normals)
        # In the tangent plane A = 1 + h W is 2 x 2: its inverse is (tr A - A) / det A (Cayley and Hamilton).
        trace = np.einsum("nii->n", turned)
        det = 1.0 + trace + 0.5 * (trace**2 - np.einsum("nij,nij->n", turned, turned))
        half = 1.0 + 0.5 * trace
        smallest = half - np.sqrt(np.maximum(half**2 - det, 0.0))
        step = (1.0 + trace)[:, None] * along - np.einsum("nij,nj->ni", turned, along)
        # Near a centre of curvature the system is singular; there a plain projection is the cautious step.
        safe = smallest > 0.2
        return np.where(safe[:, None], step / np.where(safe, det, 1.0)[:, None], along)

    def _foot(self, query: Array, face: NDArray, bary: Array, points: Array, normals: Array) -> Foot:
        offset = query - points
        height = np.einsum("ij,ij->i", offset, normals)
        length = np.linalg.norm(offset, axis=1)
        along = np.sqrt(np.maximum(length**2 - height**2, 0.0))
        at_edge = self._edges.uses[self._edges.of_face[face]] == 1
        at_corner = self._at_rim[self._welded_faces[face]]
        out = ((bary < 1e-9) & at_edge).any(axis=1) | ((bary > 1 - 1e-9) & at_corner).any(axis=1)
        beside = out & (along > 1e-3 + 1e-3 * np.abs(height))
        distance = np.where(beside, np.where(height < 0, -length, length), height)
        return Foot(points, normals, distance, face, bary, ~beside)

    def raycast(self, origins: Array, directions: Array) -> tuple[NDArray[np.int32], Array, Array]:
        """Return face (n,), barycentrics (n, 3) and distance t (n,) where rays first meet the surface; face -1, t inf: miss.

        The hit on the triangles is moved onto the smooth surface. Directions need not be unit; t is in their lengths.
        """
        origins = np.ascontiguousarray(origins, dtype=np.float64).reshape(-1, 3)
        directions = np.ascontiguousarray(directions, dtype=np.float64).reshape(-1, 3)
        face = self._scene.cast(origins, directions)
        hit = np.flatnonzero(face >= 0)
        bary, t = np.zeros((len(face), 3)), np.full(len(face), np.inf)
        if not len(hit):
            return face, bary, t
        o, d, f = origins[hit], directions[hit], face[hit]
        plane = self.surface.face_normals[f]
        reach = np.einsum("ij,ij->i", self._vertices[self._faces[f, 0]] - o, plane) / np.einsum("ij,ij->i", d, plane)
        b = np.clip(self.triangles.barycentric(f, o + reach[:, None] * d), 0.0, 1.0)
        b /= b.sum(axis=1, keepdims=True)
        for _ in range(2):
            p, n = self.evaluate(f, b)
            reach = np.einsum("ij,ij->i", p - o, n) / np.einsum("ij,ij->i", d, n)
            near = self.triangles.nearest(o + reach[:, None] * d)
            f, b = near.face, near.bary
        face[hit], bary[hit], t[hit] = f, b, reach
        return face, bary, t

    @cached_property
    def _scene(self) -> Scene:
        return Scene(self._vertices, self._faces)

    @cached_property
    def _chord(self) -> tuple[float, float]:
        gap, sine = np.zeros(len(self._faces)), np.zeros(len(self._faces))
        for i in range(0, len(gap), SLICE):
            rows = slice(i, i + SLICE)
            gap[rows], sine[rows] = self._bulge(self._faces[rows], self.surface.face_normals[rows])
        # Slivers have normals of their own; of the triangles that cover nearly all of the area, the worst.
        order = np.argsort(sine)
        covered = np.cumsum(self.surface.face_areas_mm2[order])
        worst = order[min(int(np.searchsorted(covered, COVERED * covered[-1])), len(order) - 1)]
        return float(gap.max(initial=0.0)), float(np.degrees(np.arcsin(min(1.0, sine[worst]))))

    def _bulge(self, corner: NDArray[np.int64], flat: Array) -> tuple[Array, Array]:
        """Return the largest gap (n,) between curved and flat triangles half way along edges and in the middle, and the
        largest sine (n,) between their normals.

        The cubics' control points give both in closed form: with lift_ij = (e_ij . n_i) (n_i . N), e_ij from corner i to
        j and N the flat normal, the gap is -(lift_ij + lift_ji) / 8 half way along an edge and -sum(lift) / 18 in the middle.
        """
        fit = self.vertex_fit
        points, normals = [fit.points[c] for c in corner.T], [fit.normals[c] for c in corner.T]
        cosine = [np.einsum("ij,ij->i", n, flat) for n in normals]
        # Between vertices that scatter the smooth surface does not go through them.
        off = [np.einsum("ij,ij->i", p - self._vertices[c], flat) for p, c in zip(points, corner.T, strict=True)]
        gap, total = np.zeros(len(flat)), sum(off, np.zeros(len(flat))) / 3.0
        for i, j in ((0, 1), (1, 2), (2, 0)):
            e = points[j] - points[i]
            lifts = np.einsum("ij,ij->i", e, normals[i]) * cosine[i] - np.einsum("ij,ij->i", e, normals[j]) * cosine[j]
            total -= lifts / 18.0
            np.maximum(gap, np.abs(0.5 * (off[i] + off[j]) - lifts / 8.0), out=gap)
        across = [np.linalg.norm(np.cross(n, flat), axis=1) for n in normals]
        return np.maximum(gap, np.abs(total)), np.max(across, axis=0)

    @property
    def chord_error_mm(self) -> float:
        """Estimated largest gap between the triangles and the smooth surface (mm)."""
        return self._chord[0]

    @property
    def chord_angle_deg(self) -> float:
        """Estimated largest angle between the triangles' normals and those of the smooth surface (deg)."""
        return self._chord[1]
