"""Text of a program: one table from statements to lines, ASCII, CRLF."""

from collections.abc import Callable, Iterable

from kuka_export.numbers import FRAME_FORMAT, axes_text, frame_text, real_text, written_frames
from kuka_export.profiles import Profile, profile_of
from kuka_export.program import (
    AxisMove,
    Call,
    Comment,
    DefineBase,
    External,
    Fold,
    HomeMove,
    Init,
    KrlProgram,
    Module,
    Moves,
    Setting,
    SplineBlock,
    Statement,
    Trigger,
    UseBase,
    UseTool,
    WaitInput,
)  # fmt: skip

EOL = "\r\n"

# Every KSS generation ships this fold; BAS(#INITMOV,0) sets $BASE to WORLD, hence frames come after it.
_INIT_BODY = (
    "  ;FOLD BASISTECH INI", "    GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )", "    INTERRUPT ON 3",
    "    BAS (#INITMOV,0 )", "  ;ENDFOLD (BASISTECH INI)", "  ;FOLD USER INI", "    ;Make your modifications here",
    "  ;ENDFOLD (USER INI)",
)  # fmt: skip
_DATA_BODY = (
    ";FOLD EXTERNAL DECLARATIONS;%{PE}%MKUKATPBASIS,%CEXT,%VCOMMON,%P",
    ";FOLD BASISTECH EXT;%{PE}%MKUKATPBASIS,%CEXT,%VEXT,%P", "EXT  BAS (BAS_COMMAND  :IN,REAL  :IN )",
    "DECL INT SUCCESS", ";ENDFOLD (BASISTECH EXT)", ";FOLD USER EXT;%{E}%MKUKATPUSER,%CEXT,%VEXT,%P",
    ";Make your modifications here", ";ENDFOLD (USER EXT)", ";ENDFOLD (EXTERNAL DECLARATIONS)",
)  # fmt: skip


def write_program(program: KrlProgram) -> dict[str, bytes]:
    """Return file name -> bytes of every module: ASCII, CRLF, final newline, header in the controller's order."""
    profile = profile_of(program.profile)
    files: dict[str, bytes] = {}
    for module in program.modules:
        files[f"{module.name}.src"] = source_bytes(module, profile)
        if module.data:
            files[f"{module.name}.dat"] = _bytes([*profile.header, f"DEFDAT  {module.name}", *_DATA_BODY, "ENDDAT"])
    return files


def source_bytes(module: Module, profile: Profile) -> bytes:
    """Return the `.src` of one module."""
    return _bytes([*profile.header, f"DEF {module.name} ( )", *_lines(module.body, profile), "END"])


def body_size(body: Iterable[Statement], profile: Profile) -> tuple[int, int]:
    """Return lines and bytes that statements take."""
    text = _bytes(_lines(body, profile))
    return text.count(b"\n"), len(text)


def _bytes(lines: list[str]) -> bytes:
    return (EOL.join(lines) + EOL).encode("ascii") if lines else b""


def _lines(body: Iterable[Statement], profile: Profile) -> list[str]:
    return [line for statement in body for line in TABLE[type(statement)](statement, profile)]


def _init(_: Init, profile: Profile) -> list[str]:
    return [f";FOLD {profile.init_fold}", *_INIT_BODY, ";ENDFOLD (INI)"]


def _use_base(s: UseBase, _: Profile) -> list[str]:
    offset = "" if s.offset is None else f" : {frame_text(s.offset)}"
    return [f"$BASE = BASE_DATA[{s.number}]{offset}"]


def _moves(s: Moves, _: Profile) -> list[str]:
    # One formatting call for all poses: a program may hold 300,000.
    n = len(s.poses)
    if n == 0:
        return []
    line = f"{s.word} {FRAME_FORMAT}" + (f" {s.blend}" if s.blend else "")
    return ("\n".join([line] * n) % tuple(written_frames(s.poses).ravel().tolist())).split("\n")


def _trigger(s: Trigger, _: Profile) -> list[str]:
    if s.measure == "DISTANCE":
        when = f"DISTANCE={0 if s.at == 'start' else 1}"
    else:
        when = "PATH=0" + (" ONSTART" if s.at == "start" else "")
    value = "TRUE" if s.value else "FALSE"
    action = f"PULSE($OUT[{s.output}],TRUE,{real_text(s.pulse_s)})" if s.pulse_s else f"$OUT[{s.output}]={value}"
    return [f"TRIGGER WHEN {when} DELAY=0 DO {action}"]


def _spline(s: SplineBlock, profile: Profile) -> list[str]:
    return [f"SPLINE WITH $VEL.CP={real_text(s.speed_m_s)}", *_lines(s.body, profile), "ENDSPLINE"]


def _fold(s: Fold, profile: Profile) -> list[str]:
    return [f";FOLD {s.title}", *_lines(s.body, profile), f";ENDFOLD ({s.title})"]


TABLE: dict[type, Callable[..., list[str]]] = {
    Comment: lambda s, _: [f";{s.text}"],
    Init: _init,
    External: lambda s, _: [f"EXT {s.module} ( )"],
    Setting: lambda s, _: [f"{s.variable} = {s.value}"],
    DefineBase: lambda s, _: [f"BASE_DATA[{s.number}] = {frame_text(s.frame)}"],
    UseBase: _use_base,
    UseTool: lambda s, _: [f"$TOOL = TOOL_DATA[{s.number}]"],
    Call: lambda s, _: [f"{s.module} ( )"],
    WaitInput: lambda s, _: [f"WAIT FOR $IN[{s.number}]==TRUE"],
    AxisMove: lambda s, _: [f"{s.word} {axes_text(s.axes_deg)}"],
    HomeMove: lambda s, _: [f"{s.word} XHOME"],
    Moves: _moves,
    Trigger: _trigger,
    SplineBlock: _spline,
    Fold: _fold,
}
