"""Sections of the alignment report that are words and numbers: correction, directions, key points, proof, inputs."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from alignment.estimate.directions import Direction
from alignment.estimate.verdict import describe
from app.plan import Plan
from app.report.document import Block, Cell, Column, Heading, Table, Text, Verdict
from app.report.known import ScanFacts, temperature_mm_per_c
from app.report.said import issues_of
from app.report.shown import POSE_TITLES, number, percent, shown, six, whole
from planner.frames import AXES
from planner.issues import Issue

WORDS = {"pass": "PASS", "partial": "PARTIAL", "fail": "FAIL"}
MEANING = {
    "pass": "The part is found. The corrected program may run after a dry run in T1.",
    "partial": "Usable only if somebody accepts what is said below, with name and reason.",
    "fail": "No corrected program is written.",
}
TEXT = Column(title="", look="text")
# Absolute accuracy of an uncalibrated robot of this class: A. Slamani, A. Nubiola, I. Bonev, "Assessment of the
# positioning performance of an industrial robot", Industrial Robot 39/1 (2012) 57 (0.65 mm, 0.16 deg), and the makers'
# own figures for larger ones.
ROBOT_MM = (0.3, 1.0)


def verdict_of(content: dict[str, Any]) -> list[Block]:
    """Return verdict and issues."""
    verdict = content["verdict"]
    out: list[Block] = [Verdict(tone=verdict, word=WORDS[verdict], text=MEANING[verdict])]
    return out + issues_of(content["issues"])


def correction_of(plan: Plan, content: dict[str, Any]) -> list[Block]:
    """Return the correction, the BASE it makes, and what its sigma does not know."""
    rows: list[tuple[Cell, ...]] = [(f"nominal BASE [{plan.setup.base.number}]", *six(plan.setup.base.xyzabc()))]
    if content["correction"] is not None:
        rows.append(("correction in BASE", *six(content["correction"], signed=True)))
        rows.append((f"corrected BASE [{content['base']['number']}]", *six(content["base"])))
    if content["dof"]:
        rows.append(("status", *(content["dof"][k]["status"] for k in AXES)))
        sigma = (number(content["dof"][k]["sigma"], 3 if k in "xyz" else 4) for k in AXES)
        rows.append(("sigma (1 s.d.)", *sigma))
    columns = (TEXT, *(Column(title=t) for t in POSE_TITLES))
    table = Table(name="correction", columns=columns, rows=tuple(rows))
    if content["correction"] is None:
        return [Heading(text="BASE"), table]
    return [
        Heading(text="Correction and BASE"),
        table,
        Text(
            text="The corrected BASE is the frame in which the real part sits exactly where the program believes it sits. "
            "Sigma is of the correction about the BASE origin, relative to probe, TCP and couplant as calibrated.",
            soft=True,
        ),
        _left_out(plan),
    ]


def _left_out(plan: Plan) -> Table:
    setup, part = plan.setup, plan.part
    standoff = setup.alignment_standoff_mm
    chord = part.chord_error_mm
    speed_set = setup.couplant.sound_speed_m_s
    warm = f"{setup.couplant.temperature_c:g} deg C assumed"
    assumed = warm if speed_set is None else f"{speed_set:g} m/s as set, at any temperature"
    speed = setup.alignment.scan_speed_mm_s
    rows: list[tuple[Cell, ...]] = [
        (
            "Robot, absolute accuracy",
            f"{ROBOT_MM[0]:g} to {ROBOT_MM[1]:g} mm",
            "as usual for an uncalibrated robot of this class; a smooth field over the cell",
        ),
        (
            "Water temperature",
            number(temperature_mm_per_c(plan, standoff), 3, unit="mm/K"),
            f"shift of the surface at {standoff:g} mm standoff; {assumed}",
        ),
        ("TCP calibration", "see the record", "its error moves the part with the orientation of the tool"),
        ("Probe", "see the record", "order of the laws, pitch and delay as set; amplitude curve as calibrated"),
        (
            "Latency of the poses",
            number(speed * 1e-3, 3, unit="mm/ms"),
            f"along the path at {speed:g} mm/s, opposite on forth and back passes",
        ),
        (
            "Tessellation of the CAD",
            number(chord, 3, unit="mm"),
            "estimated distance of the triangles from the true surface"
            if np.isfinite(chord)
            else "unknown for this file",
        ),
    ]
    columns = (Column(title="What sigma leaves out", look="text", share=1.1), Column(title="size"), TEXT_WIDE)
    return Table(name="left_out", columns=columns, rows=tuple(rows))


TEXT_WIDE = Column(title="what it does", look="text", share=2.4)


def directions_of(content: dict[str, Any]) -> list[Block]:
    """Return the six directions, in words and numbers."""
    found = content["directions"]
    if not found:
        return []
    rows: list[tuple[Cell, ...]] = []
    for d in found:
        vector = np.array(d["vector"])
        words = describe(Direction(d["status"], d["sigma"], vector, d["displacement_mm"], d["turn_deg"], d["locked"]))
        status = "locked" if d["locked"] else d["status"]
        rows.append((words, status, number(d["sigma"], 4), number(d["displacement_mm"], 4), number(d["turn_deg"], 4)))
    titles = ("sigma / prior", "surface moves, mm rms", "turns, deg")
    columns = (
        Column(title="direction", look="text", share=2.2),
        Column(title="status", look="text"),
        *(Column(title=t) for t in titles),
    )
    vectors = tuple(
        (str(k + 1), *(number(v, 5 if i < 3 else 3, signed=True) for i, v in enumerate(d["vector"])))
        for k, d in enumerate(found)
    )
    axes = ("rx rad", "ry rad", "rz rad", "x mm", "y mm", "z mm")
    return [
        Heading(text="Directions, as the data see them"),
        Table(name="directions", columns=columns, rows=tuple(rows)),
        Table(name="direction_vectors", columns=(TEXT, *(Column(title=t) for t in axes)), rows=vectors),
        Text(
            text="Six independent motions about the centroid of the inspection surface, in axes of BASE. Held: the data say "
            "too little, so the part stays nominal along it. Vectors are one prior standard deviation of the fixture each.",
            soft=True,
        ),
    ]


def keypoints_of(content: dict[str, Any]) -> list[Block]:
    """Return the key points with verdicts and reasons."""
    found = content["keypoints"]
    if not found:
        return []
    rows = tuple(
        (
            k["id"], k["status"], number(k["residual_mm"]), number(k["normal_angle_deg"]), whole(k["readings"]),
            number(k["amplitude_pct"], 1), number(k["tof_us"]), k["reason"] or "",
        )
        for k in found
    )  # fmt: skip
    titles = ("residual mm", "normal deg", "readings", "%FSH", "ToF us")
    columns = (
        Column(title="key point", look="text"),
        Column(title="status", look="text"),
        *(Column(title=t) for t in titles),
        Column(title="reason", look="text", share=2.0),
    )
    good = sum(k["status"] == "matched" for k in found)
    return [
        Heading(text="Key points"),
        Text(
            text=f"{good} of {len(found)} key points match."
            + (" The others are rejected for the reason given." if good < len(found) else "")
        ),
        Table(name="keypoints", columns=columns, rows=rows),
    ]


def proof_of(manifest: dict[str, Any] | None, findings: Sequence[Issue]) -> list[Block]:
    """Return the proof of the corrected program: errors of reading back, findings, hashes."""
    if manifest is None:
        return []
    largest = manifest["largest_difference"]
    rows = tuple((n, whole(f["bytes"]), f["sha256"]) for n, f in sorted(manifest["files"].items()))
    errors = sum(i.severity == "error" for i in findings)
    warnings = sum(i.severity == "warning" for i in findings)
    out: list[Block] = [
        Heading(text="Program"),
        Text(
            text=f"{manifest['program']} for {manifest['controller']}: {manifest['poses']} poses in {manifest['passes']} "
            f"passes, {len(rows)} files, {manifest['bytes']} bytes. Read back from the text by an independent reader: largest "
            f"difference {shown(number(largest['mm'], 6))} mm and {shown(number(largest['deg'], 7))} deg (half a unit of the "
            f"last decimal is 0.0005 mm and 0.00005 deg). Checked as KRL: {errors} errors, {warnings} warnings."
        ),
        *issues_of(findings),
        Table(
            name="program",
            columns=(
                Column(title="file", look="code", share=1.2),
                Column(title="bytes"),
                Column(title="SHA-256", look="code", share=3.0),
            ),
            rows=rows,
        ),
    ]
    return out


def inputs_of(named: Sequence[tuple[str, str]], scans: Sequence[ScanFacts]) -> list[Block]:
    """Return what it was made from: name and SHA-256 of everything, and the scans in numbers."""
    hashes = (*named, *((f"{s.role or 'scan'}: {s.name}", s.sha256) for s in scans))
    columns = (Column(title="input", look="text", share=1.3), Column(title="SHA-256, version", look="code", share=2.4))
    rows = tuple(
        (
            f"{s.role}: {s.name}" if s.role else s.name,
            "simulated" if s.simulated else "measured",
            whole(s.readings),
            whole(s.poses),
            percent(s.lost / s.readings if s.readings else None, 2),
            number(s.seconds, 1),
        )
        for s in scans
    )
    titles = ("readings", "poses", "no echo", "seconds")
    return [
        Heading(text="Inputs"),
        Table(name="inputs", columns=columns, rows=tuple(hashes)),
        Table(
            name="scans",
            columns=(
                Column(title="scan", look="text", share=1.6),
                Column(title="origin", look="text"),
                *(Column(title=t) for t in titles),
            ),
            rows=rows,
        ),
    ]
