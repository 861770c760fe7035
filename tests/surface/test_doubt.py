"""What a coarse tessellation leaves open, against spheres, saddles, tori and seams of known normals."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial import Delaunay

from planner.checks.tessellation import tessellation_issues
from planner.part import Part, Provenance
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.doubt import doubt_of
from planner.surface.inspection import InspectionSurface

Truth = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def sphere(radius: float) -> tuple[Callable[[np.ndarray], np.ndarray], Truth]:
    def at(uv: np.ndarray) -> np.ndarray:
        a, b = uv.T / radius
        return radius * np.stack([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)], axis=1)

    def truth(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r = np.linalg.norm(p, axis=1)
        return p / r[:, None], np.abs(r - radius)

    return at, truth


def torus(large: float, small: float) -> tuple[Callable[[np.ndarray], np.ndarray], Truth]:
    def at(uv: np.ndarray) -> np.ndarray:
        a, b = uv[:, 0] / (large + small), uv[:, 1] / small
        q = large + small * np.cos(b)
        return np.stack([q * np.sin(a), small * np.sin(b), q * np.cos(a)], axis=1)

    def truth(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        ring = p * [1.0, 0.0, 1.0]
        ring *= large / np.linalg.norm(ring, axis=1, keepdims=True)
        out = p - ring
        r = np.linalg.norm(out, axis=1)
        return out / r[:, None], np.abs(r - small)

    return at, truth


def saddle(radius: float) -> tuple[Callable[[np.ndarray], np.ndarray], Truth]:
    def at(uv: np.ndarray) -> np.ndarray:
        return np.column_stack([uv, (uv[:, 0] ** 2 - uv[:, 1] ** 2) / (2.0 * radius)])

    def truth(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        foot = p.copy()
        for _ in range(30):
            n = np.column_stack([-foot[:, 0] / radius, foot[:, 1] / radius, np.ones(len(p))])
            n /= np.linalg.norm(n, axis=1, keepdims=True)
            step = p - foot
            foot += step - np.einsum("ij,ij->i", step, n)[:, None] * n
            foot[:, 2] = (foot[:, 0] ** 2 - foot[:, 1] ** 2) / (2.0 * radius)
        return n, np.linalg.norm(p - foot, axis=1)

    return at, truth


SHAPES = {
    "sphere 400": sphere(400.0),
    "sphere 150": sphere(150.0),
    "saddle 200": saddle(200.0),
    "torus 300/120": torus(300.0, 120.0),
    "torus 800/300": torus(800.0, 300.0),
}


def patch(shape: str, edge_mm: float, even: bool) -> CurvedSurface:
    at, truth = SHAPES[shape]
    size = {"sphere 150": 240.0, "torus 300/120": 190.0}.get(shape, 400.0 if edge_mm == 100.0 else 200.0)
    n = max(round(size / edge_mm), 2) + 1
    u, v = np.meshgrid(*(np.linspace(-size / 2.0, size / 2.0, n),) * 2, indexing="ij")
    uv = np.column_stack([u.ravel(), v.ravel()])
    if not even:
        inner = np.abs(uv) < size / 2.0 - 1e-9
        uv = uv + inner * np.random.default_rng(3).uniform(-0.35, 0.35, uv.shape) * size / (n - 1)
    # Two diagonals of a square are as good as each other to Delaunay: a slight shear chooses.
    faces = Delaunay(uv @ [[1.0, 0.01], [0.0, 1.0]]).simplices.astype(np.int32)
    p = at(uv)
    cross = np.cross(p[faces[:, 1]] - p[faces[:, 0]], p[faces[:, 2]] - p[faces[:, 0]])
    inward = np.einsum("ij,ij->i", cross, truth(p[faces].mean(axis=1))[0]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    part = Part(p, faces, Provenance(shape, "0" * 64, "mm"))
    return CurvedSurface(InspectionSurface(part, np.arange(len(faces), dtype=np.int32)), 4.5)


def true_errors(curved: CurvedSurface, truth: Truth) -> tuple[float, float]:
    """Largest angle (deg) and distance (mm) from the true surface, at many points."""
    rng = np.random.default_rng(0)
    area = curved.surface.face_areas_mm2
    face = rng.choice(len(area), 20_000, p=area / area.sum()).astype(np.int32)
    points, normals = curved.evaluate(face, rng.dirichlet([1.0, 1.0, 1.0], len(face)))
    n, away = truth(points)
    return float(np.degrees(2.0 * np.arcsin(np.linalg.norm(normals - n, axis=1) / 2.0).max())), float(away.max())


@pytest.mark.parametrize("even", [True, False], ids=["grid", "uneven"])
@pytest.mark.parametrize("edge_mm", [100.0, 50.0, 20.0, 10.0])
@pytest.mark.parametrize("shape", list(SHAPES))
def test_the_estimate_is_of_the_size_of_the_true_error(shape: str, edge_mm: float, even: bool) -> None:
    curved = patch(shape, edge_mm, even)
    deg, mm = true_errors(curved, SHAPES[shape][1])
    doubt = doubt_of(curved)
    assert 0.5 * deg <= doubt.deg <= 2.0 * deg
    assert doubt.mm >= 0.5 * mm
    assert doubt.mm <= 2.5 * mm or doubt.mm < 0.03
    issues = tessellation_issues(curved, Setup())
    assert [i.code for i in issues] == (
        ["tessellation-normals"]
        if doubt.deg > 1.0 or doubt.mm > 1.5
        else ["tessellation-coarse"]
        if doubt.deg > 0.1 or doubt.mm > 0.01
        else []
    )
    # What the procedure allows never passes in silence.
    if deg > 2.0:
        assert issues[0].severity == "warning"


def test_the_warning_follows_the_tolerance_and_names_figures_and_a_remedy() -> None:
    curved = patch("sphere 400", 100.0, True)
    strict = Setup.model_validate({"tolerances": {"tilt_deg": 0.3}})
    (issue,) = tessellation_issues(curved, strict)
    assert issue.severity == "warning"
    assert "deg" in issue.message
    assert "mm2" in issue.message
    assert "finer" in issue.remedy
    (loose,) = tessellation_issues(curved, Setup.model_validate({"tolerances": {"tilt_deg": 5.0}}))
    assert loose.severity == "info"


def test_a_seam_whose_facets_hide_it_is_doubted_and_a_sound_fillet_is_not() -> None:
    """An S of two arcs: the facets beside the seam are one plane, and nothing tells where the bend changes sides."""

    def strip(turns: list[float], radius: float) -> CurvedSurface:
        heading = np.concatenate([[0.0], np.cumsum(np.radians(turns))])
        half = 0.5 * np.radians(turns)
        length = 2.0 * radius * np.sin(np.abs(half))
        step = length[:, None] * np.column_stack([np.cos(heading[:-1] + half), -np.sin(heading[:-1] + half)])
        line = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
        y = np.linspace(-40.0, 40.0, 8)
        i = np.arange(len(line) * 8).reshape(-1, 8)
        a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
        vertices = np.column_stack([np.repeat(line[:, 0], 8), np.tile(y, len(line)), np.repeat(line[:, 1], 8)])
        faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
        part = Part(vertices, faces, Provenance("strip", "0" * 64, "mm"))
        return CurvedSurface(InspectionSurface(part, np.arange(len(faces), dtype=np.int32)), 4.5)

    assert doubt_of(strip([10.0] * 6 + [-10.0] * 6, 30.0)).deg == pytest.approx(5.0, rel=0.2)
    assert doubt_of(strip([3.0] * 20, 30.0)).deg < 0.1
