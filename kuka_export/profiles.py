"""What differs between controllers, as data."""

from dataclasses import dataclass
from typing import Literal

from planner.errors import fail

MotionChoice = Literal["lin", "spline"]


@dataclass(frozen=True)
class Family:
    """The words of one way to move.

    `point` is a single straight motion, `dense` a pose of the scan; `block` says that scan poses stand in
    SPLINE ... ENDSPLINE; `blend` follows a motion that is not to stop; `trigger` is what a switching point is measured in.
    """

    point: str
    dense: str
    block: bool
    blend: str
    trigger: Literal["DISTANCE", "PATH"]


LIN_FAMILY = Family(point="LIN", dense="LIN", block=False, blend="C_DIS", trigger="DISTANCE")
SLIN_FAMILY = Family(point="SLIN", dense="SLIN", block=False, blend="C_SPL", trigger="PATH")
SPLINE_FAMILY = Family(point="SLIN", dense="SPL", block=True, blend="C_SPL", trigger="PATH")


@dataclass(frozen=True)
class Profile:
    """One controller generation: order of the header, words, and limits.

    Limits: `module_lines` per .src (RoboDK's practice for all three), `load_modules` and `load_bytes` that are in memory at
    once (KSS 5: about 15 linked files, copying stalls beyond 1.5 MB; KSS 8.3: memory is full at about 4 MB), and
    `segments` per spline block.
    """

    name: str
    header: tuple[str, ...]
    init_fold: str
    external_lines: bool
    axis_word: str
    home_first: str
    home_last: str
    families: dict[str, Family]
    default_motion: MotionChoice
    advance: int
    module_lines: int
    load_modules: int
    load_bytes: int
    segments: int
    name_limit: int = 24
    base_numbers: int = 32
    tool_numbers: int = 32


_TEMPLATE = "&PARAM TEMPLATE = C:\\KRC\\Roboter\\Template\\vorgabe"
_KRC4_HEADER = (
    "&ACCESS RVP", "&REL 1", "&PARAM EDITMASK = *", _TEMPLATE, "&PARAM DISKPATH = KRC:\\R1\\Program",
)  # fmt: skip
_KRC4_FAMILIES = {"lin": SLIN_FAMILY, "spline": SPLINE_FAMILY}

PROFILES = {
    "krc2": Profile(
        name="krc2",
        header=("&ACCESS RVP", "&REL 1", _TEMPLATE, "&PARAM EDITMASK = *"),
        init_fold="INI",
        external_lines=True,
        axis_word="PTP",
        home_first="PTP",
        home_last="PTP",
        families={"lin": LIN_FAMILY},
        default_motion="lin",
        advance=5,
        module_lines=2500,
        load_modules=15,
        load_bytes=1_500_000,
        segments=150,
        base_numbers=16,
        tool_numbers=16,
    ),
    "krc4": Profile(
        name="krc4",
        header=_KRC4_HEADER,
        init_fold="INI;%{PE}",
        external_lines=False,
        axis_word="SPTP",
        home_first="PTP",
        home_last="SPTP",
        families=_KRC4_FAMILIES,
        default_motion="spline",
        advance=3,
        module_lines=2500,
        load_modules=100,
        load_bytes=3_500_000,
        segments=150,
    ),
    "krc5": Profile(
        name="krc5",
        header=_KRC4_HEADER,
        init_fold="INI;%{PE}",
        external_lines=False,
        axis_word="SPTP",
        home_first="PTP",
        home_last="SPTP",
        families=_KRC4_FAMILIES,
        default_motion="spline",
        advance=3,
        module_lines=2500,
        load_modules=100,
        load_bytes=3_500_000,
        segments=150,
    ),
}


def profile_of(controller: str) -> Profile:
    """Return the profile of a controller; raises EchoBaseError `controller-unknown`."""
    if controller not in PROFILES:
        raise fail(
            "controller-unknown",
            f"There is no controller named '{controller}'.",
            f"Choose one of {', '.join(PROFILES)}.",
            "setup.json: controller",
        )
    return PROFILES[controller]
