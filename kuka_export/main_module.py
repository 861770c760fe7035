"""The module a person selects: run information, settings, first motion, calls. And the set-base module beside it."""

from dataclasses import dataclass

import numpy as np

from kuka_export.comments import comment_text
from kuka_export.numbers import frame_text, real_text, written_axes
from kuka_export.options import ProgramOptions
from kuka_export.profiles import Profile
from kuka_export.program import (
    AxisMove,
    Call,
    Comment,
    DefineBase,
    External,
    Fold,
    HomeMove,
    Init,
    Module,
    Setting,
    Statement,
    UseBase,
    UseTool,
)
from planner.frames import Array
from planner.setup import Setup


@dataclass(frozen=True, eq=False)
class Start:
    """Where a load starts: axis values (6,), deg, with KUKA Status and Turn, and the first pose (6,)."""

    axes_deg: Array
    status: int
    turn: int


@dataclass(frozen=True, eq=False)
class BasePlan:
    """What a program does about $BASE.

    `number`: index it uses. `frame` (6,): what BASE_DATA[number] is set to; None: untaught, nothing is assigned. `offset`
    (6,): composed onto it, None without. `nominal` (6,), `correction` (6,) or None: for the comments.
    """

    number: int
    frame: Array | None
    offset: Array | None
    nominal: Array
    correction: Array | None


def base_module(name: str, base: BasePlan, nominal_number: int) -> Module:
    """Return the set-base module: one assignment, with the numbers for entry by hand and where they come from."""
    assert base.frame is not None
    body: list[Statement] = [
        Comment(f"SETS BASE {base.number}. RUN IT, OR ENTER THE NUMBERS BY HAND:"),
        *_by_hand(base.frame),
    ]
    if base.correction is not None:
        body += [
            Comment(f"NOMINAL  {frame_text(base.nominal)}"),
            Comment(f"FOUND    {frame_text(base.correction)} IN THE NOMINAL BASE"),
            Comment(
                f"SAME AS  BASE_DATA[{nominal_number}] : {frame_text(base.correction)} WITH THE NOMINAL BASE {nominal_number}"
            ),
        ]
    body.append(DefineBase(base.number, base.frame))
    return Module(name, (Fold(f"BASE {base.number}", tuple(body)),))


def main_module(
    name: str,
    calls: list[str],
    base_call: str | None,
    base: BasePlan,
    setup: Setup,
    profile: Profile,
    options: ProgramOptions,
    information: list[str],
    scan_speed_mm_s: float,
    blend_mm: float,
    data_output: int | None,
    start: Start | None,
) -> Module:
    """Return the main module. Frames are set after INI, which sets $BASE to WORLD; BASE_DATA before the first motion."""
    body: list[Statement] = []
    if profile.external_lines:
        body += [External(m) for m in ([base_call] if base_call else []) + calls]
    body += [Init(), Fold("RUN INFORMATION", tuple(Comment(t) for t in information))]
    frames: list[Statement] = [Call(base_call)] if base_call else []
    body.append(
        Fold("SETTINGS", (*frames, *_settings(base, setup, profile, options, scan_speed_mm_s, blend_mm, data_output)))
    )
    if options.home or start is None:
        body.append(HomeMove(profile.home_first))
    if start is not None:
        body.append(Comment(f"FIRST POSE, STATUS {start.status}, TURN {start.turn}"))
        body.append(AxisMove(profile.axis_word, written_axes(start.axes_deg)))
    body += [Call(m) for m in calls]
    if options.home:
        body.append(HomeMove(profile.home_last))
    return Module(name, tuple(body), data=True)


def _settings(
    base: BasePlan,
    setup: Setup,
    profile: Profile,
    options: ProgramOptions,
    scan_speed_mm_s: float,
    blend_mm: float,
    data_output: int | None,
) -> list[Statement]:
    tool = setup.tool.number
    rows = [
        ("$LOAD", f"LOAD_DATA[{tool}]"),
        ("$ACT_BASE", str(base.number)),
        ("$ACT_TOOL", str(tool)),
        ("$IPO_MODE", "#BASE"),
        ("$ORI_TYPE", f"#{options.orientation}"),
        ("$VEL.CP", real_text(scan_speed_mm_s / 1000.0)),
        ("$ACC.CP", real_text(options.acceleration_m_s2)),
        ("$VEL.ORI1", real_text(options.turning_speed_deg_s)),
        ("$VEL.ORI2", real_text(options.turning_speed_deg_s)),
        ("$ACC.ORI1", real_text(options.turning_acceleration_deg_s2)),
        ("$ACC.ORI2", real_text(options.turning_acceleration_deg_s2)),
    ]
    if blend_mm > 0.0:
        rows.append(("$APO.CDIS", real_text(blend_mm)))
    rows.append(("$ADVANCE", str(options.advance or profile.advance)))
    if data_output is not None:
        rows.append((f"$OUT[{data_output}]", "FALSE"))
    return [UseBase(base.number, base.offset), UseTool(tool), *(Setting(k, v) for k, v in rows)]


def information(
    title: str,
    label: str,
    base: BasePlan,
    setup: Setup,
    poses: Array,
    passes: int,
    options: ProgramOptions,
    notes: tuple[str, ...],
    load: str,
) -> list[str]:
    """Return the comment lines of the main module: what this is, what it was planned with, what to check first."""
    low, high = poses[:, :3].min(axis=0), poses[:, :3].max(axis=0)
    span = " ".join(f"{k} {a:.1f}..{b:.1f}" for k, a, b in zip("XYZ", low + 0.0, high + 0.0, strict=True))
    tool = np.array(setup.tool.tcp.xyzabc())
    lines = [
        f"ECHOBASE {title.upper()} PROGRAM" + (f", {load}" if load else ""),
        f"PART {comment_text(label) or 'WITHOUT A LABEL'}",
        f"{passes} PASSES, {len(poses)} POSES",
        f"POSES IN BASE {span} MM",
        f"TOOL {setup.tool.number}, PLANNED WITH {frame_text(tool)}",
    ]
    if base.frame is None:
        lines.append(f"BASE {base.number} AS TAUGHT ON THE CONTROLLER; NOTHING IS WRITTEN TO BASE_DATA")
    else:
        lines.append(f"BASE {base.number}, SET TO {frame_text(base.frame)}")
    if base.correction is not None:
        lines += [
            f"EXPECTED BASE {frame_text(base.nominal)}" if base.frame is not None else "EXPECTED BASE AS TAUGHT",
            f"FOUND IN IT   {frame_text(base.correction)}",
        ]
    if options.adapted:
        lines.append("THE POSES WERE ADAPTED TO THE SHAPE THAT WAS MEASURED")
    if options.operator:
        lines.append(f"OPERATOR {comment_text(options.operator)}")
    if options.date:
        lines.append(f"DATE {comment_text(options.date)}")
    lines += [f"NOTE {comment_text(n)}" for n in notes if n.strip()]
    return [*lines, "RUN IN T1 AT REDUCED OVERRIDE FIRST. COMPARE TOOL AND BASE WITH THESE NUMBERS."]


def _by_hand(frame: Array) -> list[Comment]:
    text = frame_text(frame).strip("{}").split(",")
    return [Comment(part) for part in text]
