"""The correction that a plan folder already holds."""

import json
from pathlib import Path

from planner.errors import fail
from planner.frames import AXES, Transform


def last_correction(folder: Path) -> Transform | None:
    """Return `T_base_basecorr` of correction/correction.json, or None if there is none or it failed."""
    path = folder / "correction" / "correction.json"
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["verdict"] == "fail":
            return None
        six = [float(content["correction"][f"{k}_{'mm' if k in 'xyz' else 'deg'}"]) for k in AXES]
    except (ValueError, KeyError, TypeError) as error:
        raise fail("correction-damaged", "correction.json cannot be read.", "Align again.", str(path)) from error
    return Transform.from_xyzabc("base", "basecorr", six)
