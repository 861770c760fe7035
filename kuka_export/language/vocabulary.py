"""The words of KRL that this reader knows."""

MOTION_POINT = frozenset({"PTP", "LIN", "SPTP", "SLIN", "SPL"})
MOTION_CIRCLE = frozenset({"CIRC", "SCIRC"})
MOTION_RELATIVE = frozenset({"PTP_REL", "LIN_REL", "CIRC_REL", "SPTP_REL", "SLIN_REL", "SCIRC_REL", "SPL_REL"})
MOTIONS = MOTION_POINT | MOTION_CIRCLE | MOTION_RELATIVE
CLASSIC_FAMILY = frozenset({"PTP", "LIN", "CIRC", "PTP_REL", "LIN_REL", "CIRC_REL"})
SPLINE_FAMILY = MOTIONS - CLASSIC_FAMILY
CONTINUOUS = frozenset(w for w in MOTIONS if "PTP" not in w)
APPROXIMATION = frozenset({"C_PTP", "C_DIS", "C_ORI", "C_VEL", "C_SPL"})

TYPES = frozenset(
    {
        "INT", "REAL", "BOOL", "CHAR", "FRAME", "POS", "E6POS", "AXIS", "E6AXIS", "LOAD", "INERTIA", "FDAT", "LDAT",
        "PDAT", "BASIS_SUGG_T", "STATE_T", "MODUS_T", "SUCCESS_T", "SPIN", "SIGINF", "CIRC_TYPE", "IPO_MODE",
        "ORI_TYPE", "BAS_COMMAND", "MODULEPARAM_T", "EKI_STATUS", "RSI_ID", "MOVE_TYPE", "TRPSPIN", "ERROR_T",
        "KRLMSG_T", "KRLMSGPAR_T", "KRLMSGOPT_T",
    }
)  # fmt: skip

KEYWORDS = frozenset(
    {
        "AND", "ANIN", "ANOUT", "B_AND", "B_EXOR", "B_NOT", "B_OR", "BRAKE", "CASE", "CCLOSE", "CHANNEL", "CONFIRM",
        "CONST", "CONST_VEL", "CONTINUE", "COPEN", "CREAD", "CWRITE", "DECL", "DEF", "DEFAULT", "DEFDAT", "DEFFCT",
        "DELAY", "DIGIN", "DISTANCE", "DO", "ELSE", "END", "ENDDAT", "ENDFCT", "ENDFOR", "ENDIF", "ENDLOOP",
        "ENDSPLINE", "ENDSWITCH", "ENDWHILE", "ENUM", "EXIT", "EXOR", "EXT", "EXTFCT", "EXTP", "EXTFCTP", "FALSE",
        "FOR", "GLOBAL", "GOTO", "HALT", "IF", "IMPORT", "INTERRUPT", "IS", "LOOP", "MAXIMUM", "MINIMUM", "NOT",
        "OFF", "ON", "ONSTART", "OR", "PATH", "PRIO", "PTP_SPLINE", "PUBLIC", "PULSE", "REPEAT", "RESUME", "RETURN",
        "SEC", "SIGNAL", "SPLINE", "SREAD", "STEP", "STOP", "STRUC", "SWITCH", "SWRITE", "THEN", "TIME_BLOCK", "TO",
        "TRIGGER", "TRUE", "UNTIL", "WAIT", "WHEN", "WHILE", "WITH", "ENDTIME_BLOCK",
    }
    | MOTIONS
    | APPROXIMATION
    | {"INT", "REAL", "BOOL", "CHAR", "FRAME", "POS", "E6POS", "AXIS", "E6AXIS"}
)  # fmt: skip

# Names every controller knows without a declaration in the program: system functions, $config.dat and the basis packages.
PREDEFINED = frozenset(
    {
        "BAS", "IR_STOPM", "XHOME", "XHOME1", "XHOME2", "XHOME3", "XHOME4", "XHOME5", "BASE_DATA", "TOOL_DATA",
        "LOAD_DATA", "BASE_NAME", "TOOL_NAME", "BASE_TYPE", "TOOL_TYPE", "MACHINE_FRAME_DAT", "FDAT_ACT", "LDAT_ACT",
        "PDAT_ACT", "MAX_TOOL", "MAX_BASE", "FHOME", "PDEFAULT", "DEFAULT_VEL", "SUCCESS", "DEF_VEL_CP", "DEF_ACC_CP",
        "DEF_ADVANCE", "INITMOV", "ABS", "SQRT", "SIN", "COS", "TAN", "ACOS", "ATAN2", "INV_POS", "INVERSE",
        "FORWARD", "VARSTATE", "VARTYPE", "STRLEN", "STRDECLLEN", "STRCLEAR", "STRADD", "STRCOPY", "STRCOMP",
        "STRFIND", "STRTOINT", "TOUPPERCASE", "TOLOWERCASE", "ROUND", "TRUNC", "SVEL_CP", "SVEL_JOINT", "SACC_CP",
        "SACC_JOINT", "STOOL", "STOOL2", "SBASE", "SLOAD", "SIPO_MODE", "SORI_TYP", "SAPO", "SAPO_PTP", "SGEAR_JERK",
        "SJERK", "SPL_TECH", "USE_CM_PRO_VALUES", "USER_GRP", "M_COMMENT", "VEL_CP", "VEL_PTP", "ACC_CP", "ACC_PTP",
        "CLEAR_KRLMSG", "EXISTS_KRLMSG", "SET_KRLMSG", "SET_KRLDLG", "EXISTS_KRLDLG", "SET_CD_PARAMS", "CHECK_HOME",
        "H_POS", "P00", "EXT_PGNO", "GET_PGNO", "PGNO", "MOVE_EMI", "TM_START", "DELETE_BACKWARD_BUFFER", "FRM_EQUAL",
        "MBX_REC", "IS_KEY_PRESSED", "CAST_TO", "CAST_FROM", "SYNCCMD",
    }
)  # fmt: skip

CARTESIAN = ("X", "Y", "Z", "A", "B", "C")
POSE_EXTRAS = ("S", "T", "E1", "E2", "E3", "E4", "E5", "E6")
AXIS_NAMES = ("A1", "A2", "A3", "A4", "A5", "A6", "E1", "E2", "E3", "E4", "E5", "E6")
COMPONENTS = {
    "FRAME": frozenset(CARTESIAN),
    "POS": frozenset((*CARTESIAN, "S", "T")),
    "E6POS": frozenset(CARTESIAN + POSE_EXTRAS),
    "AXIS": frozenset(AXIS_NAMES[:6]),
    "E6AXIS": frozenset(AXIS_NAMES),
}
