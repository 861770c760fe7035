"""The one page that goes to the robot with the program."""

from dataclasses import dataclass
from html import escape

import numpy as np

from kuka_export.comments import comment_text
from kuka_export.numbers import frame_text
from kuka_export.program import AxisMove, Fold, KrlProgram, Statement
from kuka_export.proof import Proof
from planner.setup import Setup


@dataclass(frozen=True)
class Section:
    """A heading, and rows of (what, value); a row without a value is a step."""

    title: str
    rows: tuple[tuple[str, str], ...]


def sections(program: KrlProgram, proof: Proof, setup: Setup) -> list[Section]:
    """Return the content of the run sheet: every number on it comes from the program or the setup."""
    low, high = program.poses[:, :3].min(axis=0), program.poses[:, :3].max(axis=0)
    speeds = program.speed_mm_s[program.data_on]
    run = [
        ("Program", f"{program.name} ({program.kind}, {program.profile})"),
        ("Part", comment_text(program.label) or "without a label"),
        ("Passes, poses", f"{proof.passes}, {proof.poses}"),
        ("Scan speed", f"{speeds.max(initial=0.0):g} mm/s"),
        (
            "Extents in BASE",
            "  ".join(f"{k} {a:.1f} to {b:.1f} mm" for k, a, b in zip("XYZ", low + 0.0, high + 0.0, strict=True)),
        ),
        ("Files", f"{len(proof.sha256)} in {len(program.loads)} load(s), {proof.bytes} bytes"),
    ]
    verify = [
        (f"TOOL_DATA[{program.tool_number}] on the controller", frame_text(np.array(setup.tool.tcp.xyzabc()))),
        *_base_rows(program, setup),
        *[(f"First axis values of {load.main}", _axes(program, load.main)) for load in program.loads],
        ("Data signal", _signal(program)),
    ]
    return [
        Section("Run", tuple(run)),
        Section("Compare before the first start", tuple(verify)),
        Section("In T1", _steps(program)),
    ]


def run_sheet_text(program: KrlProgram, proof: Proof, setup: Setup) -> str:
    """Return the run sheet as plain text."""
    lines = [f"EchoBase run sheet: {program.name}", ""]
    for section in sections(program, proof, setup):
        lines += [section.title, "-" * len(section.title)]
        for k, (what, value) in enumerate(section.rows, 1):
            lines.append(f"{what}: {value}" if value else f"[ ] {k}. {what}")
        lines.append("")
    return "\n".join([*lines, "Name, date: ____________________", ""])


def run_sheet_html(program: KrlProgram, proof: Proof, setup: Setup) -> str:
    """Return the run sheet as one self-contained page."""
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        f"<title>Run sheet {escape(program.name)}</title>",
        (
            "<style>body{font:14px/1.4 system-ui,sans-serif;max-width:48em;margin:2em auto}"
            "table{border-collapse:collapse;width:100%}"
            "td{padding:.2em .6em .2em 0;vertical-align:top;border-bottom:1px solid #ddd}"
            "td+td{font-family:ui-monospace,monospace}"
            "li{margin:.3em 0}h2{font-size:1em;margin:1.4em 0 .3em}</style>"
        ),
        f"<h1>Run sheet {escape(program.name)}</h1>",
    ]
    for section in sections(program, proof, setup):
        parts.append(f"<h2>{escape(section.title)}</h2>")
        if section.rows and not section.rows[0][1]:
            parts.append("<ol>" + "".join(f"<li>{escape(what)}</li>" for what, _ in section.rows) + "</ol>")
        else:
            rows = "".join(f"<tr><td>{escape(a)}</td><td>{escape(b)}</td></tr>" for a, b in section.rows)
            parts.append(f"<table>{rows}</table>")
    return "".join([*parts, "<p>Name, date: ____________________</p></html>\n"])


def _base_rows(program: KrlProgram, setup: Setup) -> list[tuple[str, str]]:
    n = program.base_number
    if program.base_frame is not None:
        return [(f"BASE_DATA[{n}], set by the program", frame_text(program.base_frame))]
    rows = [(f"BASE_DATA[{n}]", "as taught on the controller; the program does not write it")]
    if program.base_offset is not None:
        rows.append(("Composed onto it by the program", frame_text(program.base_offset)))
    return rows


def _axes(program: KrlProgram, main: str) -> str:
    for s in _flat(program.module(main).body):
        if isinstance(s, AxisMove):
            return "  ".join(f"A{k} {v:z.2f}" for k, v in enumerate(s.axes_deg, 1)) + " deg"
    return "none: starts at XHOME"


def _flat(body: tuple[Statement, ...]) -> list[Statement]:
    found: list[Statement] = []
    for s in body:
        found += [s, *_flat(s.body)] if isinstance(s, Fold) else [s]
    return found


def _signal(program: KrlProgram) -> str:
    if program.data_output is None:
        return "none; the acquisition runs all the time"
    form = "a pulse at both ends of every pass" if program.signal == "pulse" else "TRUE while data are taken"
    wait = f"; waits for $IN[{program.wait_input}] before each pass" if program.wait_input is not None else ""
    return f"$OUT[{program.data_output}], {form}{wait}"


def _steps(program: KrlProgram) -> tuple[tuple[str, str], ...]:
    steps = [
        "Delete the modules of an earlier export of this name, then copy these.",
        "Compare tool, base and first axis values with the numbers above.",
        "Water off, probe clear. Select the main module in T1, override 10 %.",
        "Drive to the first pose (BCO run). Check that the probe stands over the start of pass 1, beam towards the part.",
        "Run the first pass without water; watch the standoff and the cables. Stop if the gap is not what was planned.",
        "Run all passes in T1, then with water at the planned speed.",
    ]
    if len(program.loads) > 1:
        steps.insert(
            1,
            f"The program comes in {len(program.loads)} loads. Copy, run and delete one after the other: "
            f"{', '.join(load.main for load in program.loads)}.",
        )
    return tuple((s, "") for s in steps)
