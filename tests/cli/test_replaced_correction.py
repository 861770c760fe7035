"""Two corrections in one folder: a scan that cannot say its BASE is warned about; one that can is believed."""

import json

import polars as pl
import pytest

from tests.loop.chain import echobase
from tests.loop.surfaces import plane, write_stl

BASE = ("base_x_mm", "base_y_mm", "base_z_mm", "base_a_deg", "base_b_deg", "base_c_deg")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A plan that was aligned twice, with scans of a part that was moved in between."""
    home = tmp_path_factory.mktemp("replaced")
    part = write_stl(home / "plate.stl", *plane().mesh(3, 3))
    job = home / "job"
    assert echobase("plan", part, "--unit", "mm", "-o", job) == 0
    for number, offset in enumerate(("0.5,0.4,0.8,0.1,-0.3,0.2", "0.5,0.4,0.2,0.1,0.2,0.2")):
        assert echobase("simulate", job, "--offset", offset, "-o", home / f"{number}.csv") == 0
        assert echobase("align", job, home / f"{number}.csv") == 0
        found = json.loads((job / "correction" / "correction.json").read_text())
        (home / f"{number}.json").write_text(json.dumps(found))
    # Readings of the second program, without and with the BASE it ran in.
    scan = pl.read_csv(home / "1.csv")
    plain = scan.drop([c for c in BASE if c in scan.columns])
    plain.write_csv(home / "silent.csv")
    base = json.loads((home / "1.json").read_text())["base"]
    plain.with_columns(pl.lit(base[c.removeprefix("base_")]).alias(c) for c in BASE).write_csv(home / "says.csv")
    return home


def test_a_correction_names_the_one_it_replaced(folder):
    first, second = (json.loads((folder / f"{n}.json").read_text()) for n in (0, 1))
    assert first["replaces"] is None
    assert second["replaces"]["correction"] == first["correction"]
    assert second["replaces"]["base"] == first["base"]
    # The same scan once more replaces nothing, and forgets nothing.
    assert echobase("align", folder / "job", folder / "1.csv") == 0
    again = json.loads((folder / "job" / "correction" / "correction.json").read_text())
    assert again["correction"] == second["correction"]
    assert again["replaces"] == second["replaces"]


@pytest.mark.parametrize(("name", "base", "warned"), [("silent", "corrected", True), ("silent", "nominal", False),
                                                      ("says", "corrected", False)])  # fmt: skip
def test_only_a_silent_scan_of_a_corrected_base_is_doubted(folder, capsys, name, base, warned):
    capsys.readouterr()
    assert echobase("assess", folder / "job", folder / f"{name}.csv", "--base", base) == 0
    said = capsys.readouterr().out
    assert ("was replaced by another one" in said) is warned
    assert ("base_x_mm" in said) is warned
