"""A tool taught wrong spoils the alignment of a plate; the patch from a sphere puts it right. All of it through files."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignment.simulator import write_readings_csv
from planner.setup import Setup
from tests.calibrate.sphere_cell import record
from tests.loop.analytic_scanner import matrix, scan, write_csv
from tests.loop.chain import echobase, error_at_face, part_in_base, pose, read, six, write
from tests.loop.surfaces import plane, write_stl

BASE = {"x_mm": 1050, "y_mm": -80, "z_mm": 400, "a_deg": 12, "b_deg": 0.5, "c_deg": -0.4}
TCP = {"x_mm": 4, "z_mm": 180, "a_deg": 15}
OFFSET, PLACEMENT = [1.1, -0.7, 1.0, 0.2, -0.8, 0.5], [20, 15, 5, 3, 0, 0]


def test_the_command_takes_plane_or_sphere(tmp_path, capsys):
    setup = Setup.model_validate({"tool": {"tcp": TCP}})
    seen = record(setup, [0.4, -0.6, 0.8], [0.7, -0.9, 0.5], np.random.default_rng(1), step_mm=2.0)
    write_readings_csv(seen, tmp_path / "sphere.csv")
    write(tmp_path / "setup.json", {"tool": {"tcp": TCP}})
    args = ("calibrate", "tcp", tmp_path / "sphere.csv", "--setup", tmp_path / "setup.json", "--json")
    assert echobase(*args, "--target", "sphere") == 0
    found = json.loads(capsys.readouterr().out)["estimates"]
    assert abs(found["radius"]["value"] - 20.0) <= found["radius"]["half_95"]
    assert echobase(*args, "--radius-mm", "20", "-o", tmp_path / "patch.json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["estimates"]["radius"] == {
        "value": 20.0,
        "sigma": 0.01,
        "half_95": 0.0196,
        "unit": "mm",
        "status": "held",
    }
    assert abs(said["estimates"]["z"]["value"] - 0.5) <= said["estimates"]["z"]["half_95"]
    assert json.loads((tmp_path / "patch.json").read_text()) == said["patch"]
    (tmp_path / "tilt.csv").write_text("b_deg,c_deg,amplitude_pct\n0,0,50\n")
    assert echobase("calibrate", "tilt", tmp_path / "tilt.csv", "--target", "sphere") == 1
    assert "TCP only" in capsys.readouterr().err


@pytest.mark.slow
def test_the_patch_puts_a_later_alignment_right(tmp_path, capsys):
    surface = plane()
    setup = {"base": BASE, "placement": pose(PLACEMENT), "tool": {"tcp": TCP}}
    write_stl(tmp_path / "part.stl", *surface.mesh(2, 2))
    write(tmp_path / "setup.json", setup)
    out = tmp_path / "out"
    planned = ("plan", tmp_path / "part.stl", "--unit", "mm", "--setup", tmp_path / "setup.json", "-o", out)
    assert echobase(*planned) == 0
    wrong = np.eye(4)
    wrong[:3, :3] = Rotation.from_rotvec(np.radians([0.5, -0.7, 0.3])).as_matrix()
    wrong[:3, 3] = 0.4, -0.6, 0.8
    turn = np.degrees(Rotation.from_matrix(wrong[:3, :3]).as_rotvec())
    cell = Setup.model_validate({"tool": {"tcp": TCP}})
    seen = record(cell, turn, wrong[:3, 3], np.random.default_rng(8), yaws=(0, 90, 180, 270))
    write_readings_csv(seen, tmp_path / "sphere.csv")
    sphere = ("calibrate", "tcp", tmp_path / "sphere.csv", "--radius-mm", "20", "--setup", tmp_path / "setup.json")
    capsys.readouterr()
    assert echobase(*sphere, "-o", tmp_path / "patch.json", "--json") == 0
    said = json.loads(capsys.readouterr().out)["estimates"]
    patched = read(tmp_path / "patch.json")["tool"]["tcp"]
    # What the patch says of the tool as taught, from its file alone: beam z, array x.
    taught = matrix(np.array([TCP.get(k, 0.0) for k in ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")], float))
    known = np.linalg.inv(taught) @ matrix(six(patched))
    rows = scan(out / "alignment", surface, part_in_base(PLACEMENT, OFFSET), setup, seed=3)
    centre = (matrix(np.array(PLACEMENT, float)) @ [75, 50, 0, 1])[:3]

    def errors(believed):
        """Height (mm) and tilt (deg) of the face if the controller believes the tool differs so from the real one."""
        stated = rows.copy()
        T = np.array([matrix(p) for p in rows[:: cell.probe.laws, :6]]) @ np.linalg.inv(wrong) @ believed
        abc = Rotation.from_matrix(T[:, :3, :3]).as_euler("ZYX", degrees=True)
        stated[:, :6] = np.repeat(np.column_stack([T[:, :3, 3], abc]), cell.probe.laws, axis=0)
        write_csv(tmp_path / "scan.csv", stated)
        # A tool that is wrong enough is refused; correction.json says where the part would be.
        status = echobase("align", out, tmp_path / "scan.csv", "--no-edges")
        found = read(out / "correction" / "correction.json")
        return status, *error_at_face(six(found["correction"]), OFFSET, centre, np.array([0, 0, 1.0]))

    _, height, _ = errors(np.eye(4))
    assert height > 0.6
    status, height, tilt = errors(known)
    assert status == 0
    # What the calibration itself leaves, beside the limits of the plate (0.02 mm, 0.02 deg). Passes whose arrays stand at
    # right angles ask for the tool's tilt twice.
    assert height < said["z"]["half_95"] + 0.02
    assert tilt < np.sqrt(2.0) * np.hypot(said["b"]["half_95"], said["c"]["half_95"]) + 0.02
    assert tilt < 0.25
