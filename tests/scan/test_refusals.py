"""Scan files that are wrong: one clear sentence each, with what to do."""

import gzip
import io

import h5py
import numpy as np
import polars as pl
import pytest

from alignment.readers import read_scan
from alignment.readers.formats import parser_of
from alignment.readers.sandboxed import parse
from planner.errors import EchoBaseError
from tests.scan.files import LAWS, columns, write_csv


def refusal(tmp_path, text: str | bytes, name: str = "scan.csv"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(EchoBaseError) as caught:
        parse(path, {"parser": parser_of(path, name), "name": name})
    (issue,) = caught.value.issues
    assert issue.severity == "error"
    assert issue.where == name
    assert issue.message.endswith(".")
    assert issue.remedy.endswith(".")
    return issue


def csv_text(**changes) -> str:
    out = io.StringIO()
    pl.DataFrame(columns() | changes).fill_nan(None).write_csv(out)
    return out.getvalue()


def test_a_missing_column_is_named_with_what_is_there_and_a_near_match(tmp_path) -> None:
    issue = refusal(tmp_path, csv_text().replace("tof_us", "tof", 1))
    assert issue.code == "column-missing"
    assert "tof_us" in issue.message
    assert "amplitude_pct" in issue.message
    assert "'tof' to 'tof_us'" in issue.remedy
    assert "law" in refusal(tmp_path, csv_text().replace(",law", ",nr", 1)).message


def test_the_sentence_comes_through_the_sandbox(tmp_path) -> None:
    path = write_csv(tmp_path / "scan.csv", columns() | {"tof_us": np.full(24, np.nan)})
    with pytest.raises(EchoBaseError, match="not one reading has a time of flight"):
        read_scan([path], names=["monday.csv"])


def test_empty_files(tmp_path) -> None:
    assert refusal(tmp_path, "").code == "scan-empty"
    assert refusal(tmp_path, csv_text().splitlines()[0]).code == "scan-empty"
    assert refusal(tmp_path, csv_text().splitlines()[0] + "\n").code == "scan-empty"


def test_not_one_echo(tmp_path) -> None:
    assert refusal(tmp_path, csv_text(tof_us=np.full(24, np.nan))).code == "tof-all-lost"


def test_a_cell_that_is_no_number_is_found(tmp_path) -> None:
    lines = csv_text().splitlines()
    cells = lines[7].split(",")
    cells[7] = "lost"
    lines[7] = ",".join(cells)
    issue = refusal(tmp_path, "\n".join(lines))
    assert issue.code == "cell-not-a-number"
    assert "row 8" in issue.message
    assert "tof_us" in issue.message
    assert "'lost'" in issue.message


@pytest.mark.parametrize(("factor", "word"), [(1e-6, "seconds"), (1e-3, "milliseconds"), (1e3, "nanoseconds")])
def test_time_of_flight_in_another_unit(tmp_path, factor, word) -> None:
    issue = refusal(tmp_path, csv_text(tof_us=columns()["tof_us"] * factor))
    assert issue.code == "tof-unit"
    assert f"like {word}" in issue.message


def test_positions_in_metres(tmp_path) -> None:
    rows = columns(40)
    path = write_csv(tmp_path / "scan.csv", rows | {key: rows[key] / 1000 for key in ("x_mm", "y_mm", "z_mm")})
    with pytest.raises(EchoBaseError, match="metres"):
        read_scan([path])


def test_a_robot_that_does_not_move(tmp_path) -> None:
    still = {key: np.full(24, columns()[key][0]) for key in ("x_mm", "z_mm", "b_deg")}
    assert refusal(tmp_path, csv_text(**still)).code == "poses-all-equal"


@pytest.mark.parametrize("kept", [5, 25, 50])
def test_a_file_cut_in_its_last_row_is_named_with_line_and_column(tmp_path, kept) -> None:
    lines = csv_text().splitlines()
    whole, last = "\n".join(lines[:12]), lines[12]
    part = last[: len(last) * kept // 60]
    issue = refusal(tmp_path, f"{whole}\n{part}")
    cells = len(part.split(","))
    assert issue.code == "csv-cut"
    assert f"line 13, the last one, has {cells} of 9 cells and ends in column '{lines[0].split(',')[cells - 1]}'" in (
        issue.message
    )
    packed = gzip.compress(f"{whole}\n{part}".encode())
    assert refusal(tmp_path, packed, "scan.csv.gz").code == "csv-cut"
    assert refusal(tmp_path, packed[:-30], "scan.csv.gz").code == "scan-unreadable"


def test_a_lost_echo_in_the_last_row_is_no_cut(tmp_path) -> None:
    lines = csv_text().splitlines()
    lines[-1] = ",".join([*lines[-1].split(",")[:-2], "", ""])
    path = tmp_path / "scan.csv"
    path.write_text("\n".join(lines) + "\n# end\n")
    assert np.isnan(read_scan([path]).tof_us[-1])


def test_an_empty_law_says_so(tmp_path) -> None:
    law = columns()["law"].astype(float)
    law[6] = np.nan
    assert refusal(tmp_path, csv_text(law=law)).message == "column 'law', reading 7: the cell is empty."


def test_json_is_no_scan(tmp_path) -> None:
    path = tmp_path / "setup.json"
    path.write_text('{"standoff_mm": 3, "tool": {"number": 1, "beam_axis": "z"}}')
    with pytest.raises(EchoBaseError, match="format is not known"):
        read_scan([path])


def test_a_pose_that_is_missing(tmp_path) -> None:
    y = columns()["y_mm"].astype(float)
    y[4:8] = np.nan
    issue = refusal(tmp_path, csv_text(y_mm=y))
    assert issue.code == "pose-missing"
    assert "y_mm" in issue.message
    assert "reading 5" in issue.message


def test_laws_below_one_and_not_whole(tmp_path) -> None:
    assert refusal(tmp_path, csv_text(law=columns()["law"] - 1)).code == "law-below-one"
    assert refusal(tmp_path, csv_text(law=columns()["law"] + 0.5)).code == "law-not-whole"


def test_a_base_that_changes_or_is_incomplete(tmp_path) -> None:
    base = {f"base_{k}": np.zeros(24) for k in ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")}
    changing = base | {"base_z_mm": np.repeat([0.0, 1.0], 12)}
    issue = refusal(tmp_path, csv_text(**changing))
    assert issue.code == "base-not-constant"
    assert "base_z_mm" in issue.message
    del base["base_c_deg"]
    assert refusal(tmp_path, csv_text(**base)).code == "base-columns-incomplete"


def test_semicolons_decimal_commas_and_ragged_rows(tmp_path) -> None:
    text = csv_text()
    german = text.replace(",", ";").replace(".", ",")
    issue = refusal(tmp_path, german)
    assert issue.code == "csv-separator"
    assert "decimal comma" in issue.message
    assert refusal(tmp_path, text.replace(",", "\t")).code == "csv-separator"
    lines = text.splitlines()
    header = lines[0]
    commas = [",".join(f"{cell},0" for cell in line.split(",")) for line in lines[1:]]
    assert refusal(tmp_path, "\n".join([header, *commas])).code == "csv-decimal-comma"
    lines[5] += ",7,8"
    assert refusal(tmp_path, "\n".join(lines)).code == "csv-malformed"


def test_damaged_and_unknown_files(tmp_path) -> None:
    packed = gzip.compress(csv_text().encode())
    assert refusal(tmp_path, packed[: len(packed) // 2], "scan.csv.gz").code == "scan-unreadable"
    assert refusal(tmp_path, b"PAR1 nonsense", "scan.parquet").code == "parquet-unreadable"
    assert refusal(tmp_path, b"\x89HDF\r\n\x1a\n nonsense", "scan.h5").code == "hdf5-unreadable"
    assert refusal(tmp_path, b"\x00\x01\x02" * 50, "scan.bin").code == "scan-format"
    assert refusal(tmp_path, csv_text().encode("utf-16"), "scan.csv").code == "csv-encoding"


def test_column_twice(tmp_path) -> None:
    lines = [f"{line},{'law' if i == 0 else 1}" for i, line in enumerate(csv_text().splitlines())]
    assert refusal(tmp_path, "\n".join(lines)).code == "column-twice"


def test_hdf5_with_the_wrong_shapes(tmp_path) -> None:
    for change in ({"poses": np.zeros((6, 7))}, {"tof_us": np.ones((5, LAWS))}, {"t_s": np.ones(3)}):
        data = {"poses": np.arange(36.0).reshape(6, 6), "tof_us": 20 + np.zeros((6, LAWS))}
        data |= {"amplitude_pct": np.ones((6, LAWS))} | change
        path = tmp_path / "scan.h5"
        with h5py.File(path, "w") as file:
            for key, value in data.items():
                file[key] = value
        with pytest.raises(EchoBaseError) as caught:
            parse(path, {"parser": "hdf5:parse_hdf5", "name": "scan.h5"})
        assert caught.value.issues[0].code == "dataset-shape"
    with h5py.File(path, "w") as file:
        file["poses"] = np.zeros((6, 6))
    with pytest.raises(EchoBaseError, match="tof_us"):
        read_scan([path])


def test_time_backwards(tmp_path) -> None:
    t = np.arange(24.0)
    t[10] = 3.0
    assert refusal(tmp_path, csv_text(t_s=t)).code == "time-backwards"
