"""A finding, and what every rule code means on the controller."""

from dataclasses import dataclass
from typing import NamedTuple

from planner.issues import Issue, Severity


class Finding(NamedTuple):
    """One finding in one line."""

    line: int
    code: str
    message: str
    severity: Severity = "error"


@dataclass(frozen=True)
class Rule:
    """KSS message the fault provokes (None: not known) and what to do."""

    kss: int | None
    remedy: str


RULES: dict[str, Rule] = {
    "krl-advance": Rule(None, "$ADVANCE takes 0 to 5."),
    "krl-approximation": Rule(None, "PTP, LIN and CIRC take C_PTP, C_DIS, C_ORI, C_VEL; SPTP, SLIN and SCIRC take C_SPL."),
    "krl-ascending": Rule(2074, "List the elements of an array in ascending order."),
    "krl-ascii": Rule(2162, "Write plain ASCII; transliterate names and comments."),
    "krl-assignment": Rule(None, "One '=' assigns, two compare; ':=' is Pascal."),
    "krl-base-unset": Rule(1516, "Set $BASE after INI: BAS(#INITMOV,0) makes it WORLD."),
    "krl-bom": Rule(2162, "Save without a byte order mark."),
    "krl-character": Rule(2162, "Remove the character."),
    "krl-component": Rule(2125, "A frame has X Y Z A B C, a position also S T E1-E6, axes A1-A6 E1-E6."),
    "krl-component-twice": Rule(2125, "Give every component once."),
    "krl-controller": Rule(None, "Write for the controller's own KSS generation."),
    "krl-dat-statement": Rule(2039, "A data list holds declarations and their values only."),
    "krl-declaration-late": Rule(2038, "Declare before the first statement, INI included."),
    "krl-declared-twice": Rule(2324, "Declare a name once."),
    "krl-def": Rule(None, "Start a program with DEF NAME ( ) and a data list with DEFDAT NAME."),
    "krl-def-name": Rule(2051, "Give file and first routine the same name."),
    "krl-duplicate-pose": Rule(1456, "Remove one of the two motions."),
    "krl-end": Rule(None, "Close DEF by END, DEFFCT by ENDFCT, DEFDAT by ENDDAT."),
    "krl-final-newline": Rule(None, "End the last line with CR LF."),
    "krl-first-motion": Rule(1443, "Start with PTP or SPTP to axis values, XHOME or a full position."),
    "krl-fold": Rule(None, "Close every ;FOLD by ;ENDFOLD."),
    "krl-frame-incomplete": Rule(None, "Give all of X Y Z A B C."),
    "krl-global-dat": Rule(None, "Write DEFDAT NAME PUBLIC."),
    "krl-header": Rule(None, "Headers are &ACCESS, &REL, &COMMENT, &PARAM NAME = value, before the first DEF."),
    "krl-index": Rule(None, "Use an index that the controller has."),
    "krl-init-in-src": Rule(None, "Put the value in the data list, or assign it after INI."),
    "krl-interrupt": Rule(None, "Interrupts have numbers 1 to 128."),
    "krl-jump": Rule(None, "Give the label in the same routine, once."),
    "krl-line-ends": Rule(None, "End lines with CR LF."),
    "krl-local-routines": Rule(2710, "Spread the routines over modules."),
    "krl-long-line": Rule(None, "Keep lines short."),
    "krl-mixed-families": Rule(None, "Use one family; the robot stops at every change."),
    "krl-module-name": Rule(3158, "Use letters, digits and _; start with a letter; no word of the language."),
    "krl-module-size": Rule(1006, "Split the module, decimate the path."),
    "krl-module-twice": Rule(None, "Module names are unique over all folders."),
    "krl-name-keyword": Rule(None, "Choose another name."),
    "krl-name-length": Rule(3157, "Names have 24 characters at most."),
    "krl-nesting": Rule(None, "Close every IF, FOR, WHILE, REPEAT, LOOP and SWITCH in order."),
    "krl-not-finite": Rule(None, "Write a finite number."),
    "krl-number": Rule(None, "Write a number with a point, not with a comma or a unit."),
    "krl-outside": Rule(None, "Put the line between DEF and END."),
    "krl-real": Rule(None, "A REAL holds up to 3.4E38."),
    "krl-range": Rule(None, "Use a value in the range."),
    "krl-recursion": Rule(1424, "Break the circle of calls."),
    "krl-speed": Rule(None, "$VEL.CP is in m/s: above 0, at most 3."),
    "krl-spl-outside": Rule(None, "SPL stands between SPLINE and ENDSPLINE."),
    "krl-spline-approximation": Rule(2360, "Remove it; the block itself may be blended."),
    "krl-spline-distance": Rule(2363, "Use TRIGGER WHEN PATH inside a block."),
    "krl-spline-empty": Rule(None, "Put segments into the block, or remove it."),
    "krl-spline-long": Rule(3273, "Split the block."),
    "krl-spline-open": Rule(None, "Pair SPLINE with ENDSPLINE in the same routine."),
    "krl-spline-statement": Rule(2359, "A block holds SPL, SLIN, SCIRC, TRIGGER WHEN PATH, CONST_VEL, TIME_BLOCK, STOP WHEN."),
    "krl-status": Rule(None, "S is 0 to 31; T is 0 to 4095, one bit an axis."),
    "krl-string": Rule(None, "Close the text."),
    "krl-sub-ini": Rule(None, "Only the module that is selected initialises; INI sets $BASE to WORLD."),
    "krl-syntax": Rule(None, "Correct the line."),
    "krl-target": Rule(None, "LIN, CIRC, SLIN and SPL go to positions; PTP and SPTP also to axis values."),
    "krl-trigger": Rule(None, "DISTANCE is 0 or 1; PATH is for LIN, CIRC and splines."),
    "krl-trigger-dangling": Rule(None, "Put the trigger in front of the motion it belongs to."),
    "krl-trigger-priority": Rule(None, "A subprogram call needs PRIO: -1, 1, 2, 4-39 or 81-128."),
    "krl-type": Rule(2125, "A component is a number."),
    "krl-undeclared": Rule(2135, "Declare it, or make sure that it is global on the controller."),
    "krl-wait": Rule(None, "WAIT SEC 0.5 or WAIT FOR $IN[1]."),
}  # fmt: skip


def issue(file: str, f: Finding) -> Issue:
    """Return the finding as an `Issue`: the KSS message number, where known, stands in the sentence."""
    rule = RULES.get(f.code, Rule(None, "Correct the line."))
    number = f" (KSS {rule.kss})" if rule.kss else ""
    return Issue(f.severity, f.code, f.message.rstrip(".") + number + ".", rule.remedy, f"{file}:{f.line}")
