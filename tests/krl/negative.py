"""KRL that must be refused: what is wrong, the rule that says so, the KSS message it would provoke where that is known."""

# ruff: noqa: E501 (KRL text stays in one piece)

from typing import NamedTuple

HEAD = "&ACCESS RVP\n&REL 1\n"
INI = "BAS (#INITMOV,0 )\n$BASE = BASE_DATA[1]\n$TOOL = TOOL_DATA[1]\n"
START = "PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 10.0,A6 0.0}\n"
P1 = "{X 10.0,Y 0.0,Z 5.0,A 0.0,B 0.0,C 180.0}"
P2 = "{X 20.0,Y 0.0,Z 5.0,A 0.0,B 0.0,C 180.0}"
P3 = "{X 30.0,Y 0.0,Z 5.0,A 0.0,B 0.0,C 180.0}"


class Case(NamedTuple):
    name: str
    rule: str
    kss: int | None
    files: dict[str, str]


def program(body: str, declarations: str = "") -> dict[str, str]:
    return {"JOB.src": f"{HEAD}DEF JOB ( )\n{declarations}{INI}{START}{body}END\n"}


def case(name: str, rule: str, kss: int | None, body: str, declarations: str = "") -> Case:
    return Case(name, rule, kss, program(body, declarations))


NEGATIVE = [
    Case("def-is-not-the-file", "krl-def-name", 2051, {"JOB.src": "DEF WORK ( )\nEND\n"}),
    Case("defdat-is-not-the-file", "krl-def-name", 2051, {"JOB.dat": "DEFDAT OTHER\nENDDAT\n"}),
    Case("module-name-of-25", "krl-name-length", 3157, {"A234567890123456789012345.src": "DEF A234567890123456789012345 ( )\nEND\n"}),
    Case("module-name-with-hyphen", "krl-module-name", 3158, {"MY-JOB.src": "DEF MYJOB ( )\nEND\n"}),
    Case("module-named-like-a-word", "krl-module-name", 3158, {"LOOP.src": "DEF LOOPS ( )\nEND\n"}),
    case("variable-name-of-25", "krl-name-length", 3157, "", "DECL INT A234567890123456789012345\n"),
    Case("no-def", "krl-outside", None, {"JOB.src": "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\n"}),
    Case("empty-file", "krl-def", None, {"JOB.src": ""}),
    Case("no-end", "krl-end", None, {"JOB.src": "DEF JOB ( )\nHALT\n"}),
    Case("closed-by-the-wrong-word", "krl-end", None, {"JOB.src": "DEF JOB ( )\nHALT\nENDFCT\n"}),
    Case("statement-after-end", "krl-outside", None, {"JOB.src": "DEF JOB ( )\nEND\nHALT\n"}),
    Case("def-without-parentheses", "krl-syntax", None, {"JOB.src": "DEF JOB\nEND\n"}),
    Case("header-after-def", "krl-header", None, {"JOB.src": "DEF JOB ( )\n&REL 4\nEND\n"}),
    Case("dollar-instead-of-ampersand", "krl-outside", None, {"JOB.src": "$PARAM EDITMASK = *\nDEF JOB ( )\nEND\n"}),
    Case("umlaut-in-a-comment", "krl-ascii", 2162, {"JOB.src": "DEF JOB ( )\n; Pr\u00fcfung\nEND\n"}),
    Case("byte-order-mark", "krl-bom", 2162, {"JOB.src": "\ufeffDEF JOB ( )\nEND\n"}),
    Case("null-byte", "krl-ascii", 2162, {"JOB.src": "DEF JOB ( )\nHALT \x00\nEND\n"}),
    Case("same-module-in-two-folders", "krl-module-twice", None, {"a/JOB.src": "DEF JOB ( )\nEND\n", "b/JOB.src": "DEF JOB ( )\nHALT\nEND\n"}),
    case("fold-left-open", "krl-fold", None, ";FOLD PASS 1\nHALT\n"),
    case("fold-closed-twice", "krl-fold", None, ";FOLD A\n;ENDFOLD (A)\n;ENDFOLD (A)\n"),
    case("unknown-component", "krl-component", 2125, "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,D 0.0}\n"),
    case("component-twice", "krl-component-twice", 2125, "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,B 0.0}\n"),
    case("line-to-axis-values", "krl-target", None, "LIN {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}\n"),
    case("axes-and-position-mixed", "krl-component", 2125, "PTP {A1 0.0,X 10.0}\n"),
    case("component-is-a-text", "krl-type", 2125, 'LIN {X "ten",Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\n'),
    case("not-a-number", "krl-not-finite", None, "LIN {X NAN,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\n"),
    case("number-beyond-real", "krl-real", None, "LIN {X 1.0E39,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\n"),
    case("decimal-comma", "krl-syntax", None, "LIN {X 1,5,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\n"),
    case("unit-behind-a-number", "krl-number", None, "LIN {X 15mm,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\n"),
    case("brace-left-open", "krl-syntax", None, "LIN {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0\n"),
    case("equals-in-an-aggregate", "krl-assignment", None, "LIN {X=1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}\n"),
    case("type-tag-forbids-component", "krl-component", 2125, "PTP {FRAME: X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,S 2,T 3}\n"),
    case("status-out-of-range", "krl-status", None, "PTP {X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0,S 64,T 3}\n"),
    case("base-index-33", "krl-index", None, "$BASE = BASE_DATA[33]\n"),
    case("base-index-0", "krl-index", None, "BASE_DATA[0] = {X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\n"),
    case("tool-by-bas-99", "krl-index", None, "BAS (#TOOL,99)\n"),
    case("output-0", "krl-index", None, "$OUT[0] = TRUE\n"),
    case("axis-speed-of-axis-13", "krl-index", None, "$VEL_AXIS[13] = 50\n"),
    case("path-speed-in-mm", "krl-speed", None, "$VEL.CP = 100.0\n"),
    case("path-speed-zero", "krl-speed", None, "$VEL.CP = 0.0\n"),
    case("path-speed-in-a-with-clause", "krl-speed", None, f"SPLINE WITH $VEL.CP=50.0\nSPL {P1}\nENDSPLINE\n"),
    case("path-speed-by-bas", "krl-speed", None, "BAS (#VEL_CP,250)\n"),
    case("advance-9", "krl-advance", None, "$ADVANCE = 9\n"),
    case("blending-negative", "krl-range", None, "$APO.CDIS = -1.0\n"),
    case("same-pose-twice", "krl-duplicate-pose", 1456, f"LIN {P1}\nLIN {P1}\n"),
    case("same-pose-twice-in-a-spline", "krl-duplicate-pose", 1456, f"SPLINE\nSPL {P1}\nSPL {P2}\nSPL {P2}\nENDSPLINE\n"),
    case("ptp-in-a-spline", "krl-spline-statement", 2359, f"SPLINE\nSPL {P1}\nPTP {P2}\nENDSPLINE\n"),
    case("assignment-in-a-spline", "krl-spline-statement", 2359, f"SPLINE\nSPL {P1}\n$VEL.CP = 0.1\nSPL {P2}\nENDSPLINE\n"),
    case("wait-in-a-spline", "krl-spline-statement", 2359, f"SPLINE\nSPL {P1}\nWAIT SEC 0.1\nSPL {P2}\nENDSPLINE\n"),
    case("blending-in-a-spline", "krl-spline-approximation", 2360, f"SPLINE\nSPL {P1} C_DIS\nSPL {P2}\nENDSPLINE\n"),
    case("distance-trigger-in-a-spline", "krl-spline-distance", 2363, f"SPLINE\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE\nSPL {P1}\nENDSPLINE\n"),
    case("spline-left-open", "krl-spline-open", None, f"SPLINE\nSPL {P1}\n"),
    case("endspline-alone", "krl-spline-open", None, f"LIN {P1}\nENDSPLINE\n"),
    case("spline-in-a-spline", "krl-spline-open", None, f"SPLINE\nSPL {P1}\nSPLINE\nSPL {P2}\nENDSPLINE\n"),
    case("spline-without-segments", "krl-spline-empty", None, "SPLINE\nENDSPLINE\n"),
    case("spl-without-a-spline", "krl-spl-outside", None, f"SPL {P1}\n"),
    case("trigger-after-the-last-segment", "krl-trigger-dangling", None, f"SPLINE\nSPL {P1}\nTRIGGER WHEN PATH=0 DELAY=0 DO $OUT[1]=FALSE\nENDSPLINE\n"),
    case("trigger-at-half-way", "krl-trigger", None, f"TRIGGER WHEN DISTANCE=0.5 DELAY=0 DO $OUT[1]=TRUE\nLIN {P1}\n"),
    case("path-trigger-before-ptp", "krl-trigger", None, f"TRIGGER WHEN PATH=5 DELAY=0 DO $OUT[1]=TRUE\nPTP {P1}\n"),
    case("onstart-with-distance", "krl-trigger", None, f"TRIGGER WHEN DISTANCE=0 ONSTART DELAY=0 DO $OUT[1]=TRUE\nLIN {P1}\n"),
    case("trigger-call-without-priority", "krl-trigger-priority", None, f"TRIGGER WHEN DISTANCE=0 DELAY=0 DO MARK ( )\nLIN {P1}\n"),
    case("trigger-without-delay", "krl-syntax", None, f"TRIGGER WHEN DISTANCE=0 DO $OUT[1]=TRUE\nLIN {P1}\n"),
    case("c-spl-behind-lin", "krl-approximation", None, f"LIN {P1} C_SPL\n"),
    case("c-dis-behind-slin", "krl-approximation", None, f"SLIN {P1} C_DIS\n"),
    case("approximation-misspelt", "krl-approximation", None, f"LIN {P1} C_DIST\n"),
    case("keyword-misspelt", "krl-syntax", None, f"LINN {P1}\n"),
    case("if-without-then", "krl-syntax", None, "IF $IN[1]==TRUE\nENDIF\n"),
    case("if-left-open", "krl-nesting", None, "IF $IN[1]==TRUE THEN\nHALT\n"),
    case("loop-closed-by-endfor", "krl-nesting", None, "LOOP\nHALT\nENDFOR\n"),
    case("else-alone", "krl-nesting", None, "ELSE\n"),
    case("exit-outside-a-loop", "krl-nesting", None, "EXIT\n"),
    case("goto-nowhere", "krl-jump", None, "GOTO NOWHERE\n"),
    case("label-twice", "krl-jump", None, "HERE:\nHERE:\n"),
    case("pascal-assignment", "krl-assignment", None, "$VEL.CP := 0.1\n"),
    case("comparison-as-assignment", "krl-assignment", None, "$OUT[1] == TRUE\n"),
    case("two-statements-in-a-line", "krl-syntax", None, "$VEL.CP = 0.1 $ACC.CP = 1.0\n"),
    case("wait-without-sec", "krl-wait", None, "WAIT 0.5\n"),
    case("call-without-parentheses", "krl-syntax", None, "SUBJOB\n"),
    case("text-left-open", "krl-string", None, 'NOTE ("half\n'),
    case("word-as-a-variable", "krl-name-keyword", None, "", "DECL INT LOOP\n"),
    case("declared-after-a-statement", "krl-declaration-late", 2038, "DECL INT N\n"),
    case("declared-twice", "krl-declared-twice", 2324, "", "DECL INT N\nDECL REAL N\n"),
    case("interrupt-200", "krl-interrupt", None, "INTERRUPT DECL 200 WHEN $IN[1]==TRUE DO STOPPED ( )\n"),
    Case("first-motion-is-a-line", "krl-first-motion", 1443, {"JOB.src": f"DEF JOB ( )\n{INI}LIN {P1}\nEND\n"}),
    Case("first-motion-leaves-axes-out", "krl-first-motion", 1443, {"JOB.src": f"DEF JOB ( )\n{INI}PTP {{A1 10.0}}\nEND\n"}),
    Case("statement-in-a-data-list", "krl-dat-statement", 2039, {"JOB.dat": "DEFDAT JOB\nHALT\nENDDAT\n"}),
    Case("array-not-ascending", "krl-ascending", 2074, {"JOB.dat": "DEFDAT JOB\nDECL INT N[3]\nN[2]=1\nN[1]=2\nENDDAT\n"}),
    Case("declared-in-both", "krl-declared-twice", 2324, {"JOB.src": "DEF JOB ( )\nDECL INT N\nEND\n", "JOB.dat": "DEFDAT JOB\nDECL INT N=1\nENDDAT\n"}),
    Case("component-not-of-the-type", "krl-component", 2125, {"JOB.dat": "DEFDAT JOB\nDECL FRAME F={X 1.0,Y 0.0,Z 0.0,A1 0.0}\nENDDAT\n"}),
    Case("two-routines-of-one-name", "krl-declared-twice", 2324, {"JOB.src": "DEF JOB ( )\nEND\nDEF SUB ( )\nEND\nDEF SUB ( )\nEND\n"}),
]  # fmt: skip
# On one controller only.
NEGATIVE_KRC2 = [
    case("sptp-on-krc2", "krl-controller", None, "SPTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}\n"),
    case("slin-on-krc2", "krl-controller", None, f"SLIN {P1}\nSLIN {P2}\nSLIN {P3}\n"),
    case("base-17-on-krc2", "krl-index", None, "$BASE = BASE_DATA[17]\n"),
]
