"""Builds `report.html` from what the alignment found."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from alignment.metrics import Expected
from app.plan import Plan, part_json
from app.report.figures import histogram_svg, map_svg
from planner.couplant import water_speed_m_s
from planner.frames import Array
from planner.setup import Pose, Setup

KEYS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
METHODS = {"map": "point-to-surface estimate (MAP)", "keypoints": "key-point method (Riise et al.)"}


@dataclass(frozen=True, eq=False)
class Deviation:
    """Measured less expected position along the normal, of n patches at points_part (n, 3), mm; + is outside.

    before_mm, after_mm (n,): against the part where the plan believed it, and where it was found.
    """

    points_part: Array
    before_mm: Array
    after_mm: Array


@dataclass(frozen=True, eq=False)
class ReportData:
    """What the report shows beside correction.json.

    before, after: the inspection as the centre law sees it; None where nothing could be estimated. baseline: the
    key-point method on the same readings (X Y Z mm, A B C deg) or None. scans: name and SHA-256 of each.
    """

    correction: dict[str, Any]
    before: Expected | None
    after: Expected | None
    deviation: Deviation
    baseline: Sequence[float] | None = None
    manifest: dict[str, Any] | None = None
    scans: Sequence[tuple[str, str]] = field(default_factory=tuple)


def report_html(plan: Plan, data: ReportData) -> bytes:
    """Return the report, one self-contained page without scripts."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=jinja2.StrictUndefined
    )
    setup, content = plan.setup, data.correction
    page = environment.get_template("template.html").render(
        c=content,
        part=part_json(plan.part),
        method_text=METHODS[content["method"]],
        bases=[
            ("nominal BASE", setup.base.xyzabc()),
            *_found_bases(content),
        ],
        temperature_um_per_c=1000.0 * temperature_mm_per_c(plan),
        deviation=_maps(plan, data),
        histograms=_histograms(setup, data),
        baseline=None
        if data.baseline is None or content["correction"] is None
        else [
            ("key-point method", tuple(data.baseline)),
            ("this correction", _six(content["correction"])),
        ],
        proof=_proof(data.manifest),
        inputs=[
            ("part SHA-256", content["inputs"]["part_sha256"]),
            ("plan SHA-256", content["inputs"]["plan_sha256"]),
            *((f"scan {name}", sha) for name, sha in data.scans),
            ("EchoBase", version("echobase")),
        ],
    )
    return page.encode()


def temperature_mm_per_c(plan: Plan) -> float:
    """Return how far the surface seems to move per deg C of wrong temperature at the alignment's standoff (mm)."""
    t = plan.setup.couplant.temperature_c
    slope = (water_speed_m_s(min(t + 0.5, 95.0)) - water_speed_m_s(max(t - 0.5, 0.0))) / water_speed_m_s(t)
    return plan.setup.alignment_standoff_mm * slope


def _found_bases(content: dict[str, Any]) -> list[tuple[str, tuple[float, ...]]]:
    if content["correction"] is None:
        return []
    corrected = f"corrected BASE [{content['base']['number']}]"
    return [("correction in BASE", _six(content["correction"])), (corrected, _six(content["base"]))]


def _histograms(setup: Setup, data: ReportData) -> list[tuple[str, str]]:
    if data.before is None or data.after is None:
        return []
    seen = [(e.standoff_mm[e.on_part] - setup.standoff_mm, e.db[e.on_part]) for e in (data.before, data.after)]
    tolerance, loss = setup.tolerances.standoff_mm, setup.tolerances.loss_db
    return [
        (
            "Standoff error of the inspection, centre law",
            histogram_svg(seen[0][0], seen[1][0], "standoff error (mm)", (-tolerance, tolerance)),
        ),
        (
            "Amplitude change through tilt, centre law",
            histogram_svg(seen[0][1], seen[1][1], "amplitude (dB)", (-loss,)),
        ),
    ]


def _six(pose: dict[str, float]) -> tuple[float, ...]:
    return Pose.model_validate({k: pose[k] for k in KEYS}).xyzabc()


def _maps(plan: Plan, data: ReportData) -> list[tuple[str, str]]:
    found = data.deviation
    if not len(found.points_part):
        return []
    uv, frame = in_surface_axes(plan, found.points_part)
    outline = [(loop @ frame[:, :2]) for loop in _outline(plan)]
    wide = max(0.05, float(np.nanpercentile(np.abs(np.r_[found.before_mm, found.after_mm]), 99)))
    fine = max(0.02, float(np.nanpercentile(np.abs(found.after_mm), 99)))
    label = "measured - expected (mm)"
    return [
        ("Deviation along the normal before the correction", map_svg(uv, found.before_mm, label, wide, outline)),
        ("The same after the correction, on a finer scale", map_svg(uv, found.after_mm, label, fine, outline)),
    ]


def in_surface_axes(plan: Plan, points_part: Array) -> tuple[Array, Array]:
    """Return points (n, 2) in the surface's own axes (longest extent first), and those axes as columns (3, 3)."""
    normal = plan.surface.mean_normal_part
    flat = plan.surface.vertices - plan.surface.centroid_part
    flat = flat - np.outer(flat @ normal, normal)
    along = np.linalg.svd(flat, full_matrices=False)[2][0]
    along = along * np.sign(along[np.argmax(np.abs(along))])
    frame = np.stack([along, np.cross(normal, along), normal], axis=1)
    return points_part @ frame[:, :2], frame


def _outline(plan: Plan) -> list[Array]:
    from planner.surface.boundary import boundary  # noqa: PLC0415 - drawn only when there is a map

    return [np.vstack([curve.points, curve.points[:1]]) for curve in boundary(plan.surface)]


def _proof(manifest: dict[str, Any] | None) -> dict[str, Any] | None:
    if manifest is None:
        return None
    files = [{"name": name, **entry} for name, entry in sorted(manifest["files"].items())]
    sentence = (
        f"{manifest['poses']} poses in {len(files)} files, read back from the text by an independent reader: largest "
        f"difference {manifest['largest_difference']['mm']:.5f} mm and {manifest['largest_difference']['deg']:.6f} deg."
    )
    return {"sentence": sentence, "files": files}
