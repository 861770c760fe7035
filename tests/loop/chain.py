"""Runs the command line as a user would and places the part where a truth says."""

import json
from pathlib import Path

import numpy as np

from app.__main__ import main
from tests.loop.analytic_scanner import matrix


def echobase(*args) -> int:
    """Run one command in this process; return the exit status."""
    return main([str(a) for a in args])


def pose(six) -> dict:
    return dict(zip(("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"), six, strict=True))


def six(content: dict) -> np.ndarray:
    return np.array([content[k] for k in ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")])


def part_in_base(placement, correction, T_cad_surface=None) -> np.ndarray:
    """T_base_part (4, 4) of a placement and a correction, times the pose of the analytic surface in its CAD."""
    T = matrix(np.asarray(correction, float)) @ matrix(np.asarray(placement, float))
    return T if T_cad_surface is None else T @ T_cad_surface


def read(path: Path) -> dict:
    return json.loads(path.read_text(encoding="utf-8"))


def write(path: Path, content) -> Path:
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def error_at_face(found, applied, centre, normal):
    """Height of the face centre (mm) and tilt of its normal (deg) between two corrections, both seen in base."""
    A, B = matrix(np.asarray(applied, float)), matrix(np.asarray(found, float))
    height = float(normal @ ((B @ [*centre, 1.0])[:3] - (A @ [*centre, 1.0])[:3]))
    n_a, n_b = A[:3, :3] @ normal, B[:3, :3] @ normal
    return abs(height), float(np.degrees(np.arcsin(np.clip(np.linalg.norm(np.cross(n_a, n_b)), 0, 1))))
