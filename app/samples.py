"""The sample parts that come with EchoBase."""

from dataclasses import dataclass
from pathlib import Path

from app.inputs import read_setup
from planner.errors import fail
from planner.setup import Setup

NAMES = ("aerofoil", "flat-plate")
# Beside the packages in a checkout, inside the package in an installed wheel.
_PLACES = (Path(__file__).parents[1] / "sample_parts", Path(__file__).parent / "_sample_parts")


@dataclass(frozen=True)
class Sample:
    """A sample part: CAD file, its unit (None: the file carries it), the cell it stands in, a hidden offset to find."""

    name: str
    source: Path
    unit: str | None
    setup: Setup
    hidden_offset: tuple[float, float, float, float, float, float]


# The paper's flat-plate offset, and one of the size a fixture leaves on a long part (X Y Z mm, A B C deg).
_OFFSETS = {"flat-plate": (1.1, -0.7, 1.0, 0.2, -0.8, 0.5), "aerofoil": (1.4, -1.9, -3.2, 0.12, 0.08, 1.3)}


def sample(name: str) -> Sample:
    """Return a sample part by name; raise EchoBaseError for an unknown one."""
    if name not in NAMES:
        raise fail("sample-unknown", f"there is no sample part '{name}'.", f"Choose one of {', '.join(NAMES)}.")
    folder = next((p / name for p in _PLACES if (p / name).is_dir()), None)
    if folder is None:
        raise fail("sample-missing", "this installation came without the sample parts.", "Install EchoBase anew.")
    source = sorted(folder.glob("*.step"))[0]
    return Sample(name, source, None, read_setup(folder / "setup.json"), _OFFSETS[name])
