"""Numbers as the commands print them: no negative zero, no None, and no BASE in numbers that mean nothing."""

from app.cli.commands.align import base_line, pose_line
from app.cli.commands.calibrate import estimate_text

SMALL = {"x_mm": -0.0004, "y_mm": -0.0006, "z_mm": 0.0, "a_deg": -0.00004, "b_deg": -0.00006, "c_deg": -90.0}


def test_what_rounds_to_zero_has_no_sign() -> None:
    line = pose_line(SMALL)
    assert line.split() == ["X", "0.000", "Y", "-0.001", "Z", "0.000", "A", "0.0000", "B", "-0.0001", "C", "-90.0000"]


def test_an_untaught_base_is_not_given_in_numbers() -> None:
    corrected = dict.fromkeys(SMALL, 1.5)
    untaught = base_line({"correction": corrected, "base": {"number": 6, **corrected}})
    assert untaught == "BASE[6]    as taught on the controller; the program composes the correction onto it"
    taught = base_line({"correction": SMALL, "base": {"number": 2, **corrected}})
    assert taught.startswith("BASE[2]")
    assert taught.count("1.500") == 6


def test_estimates_have_the_decimals_they_deserve() -> None:
    seen = {"value": 1.357921, "sigma": 0.005, "half_95": 0.00994, "unit": "dB/deg^2", "status": "measured"}
    assert estimate_text(seen) == "1.3579 +- 0.0099 dB/deg^2 (95 %), measured"
    assert estimate_text(seen | {"value": -4e-18}).startswith("0.0000 +-")
    assert (
        estimate_text(seen | {"value": None, "sigma": None, "half_95": None, "status": "held"})
        == "held: stays as it was"
    )
