"""`echobase calibrate` and `echobase robot`: from files to a patch of setup.json and to a robot that plans."""

import json

import numpy as np

from tests.loop.chain import echobase
from tests.loop.surfaces import plane, write_stl
from tests.robot.test_backup import CONFIG, MACHINE


def test_tilt_calibration_writes_a_patch(tmp_path, capsys):
    rng = np.random.default_rng(3)
    b, c = (v.ravel() for v in np.meshgrid(np.linspace(-1.2, 1.2, 13), np.linspace(-1.2, 1.2, 13)))
    amplitude = 52.0 * 10 ** (-(1.7 * b**2 + 0.8 * c**2) / 20) * (1 + 0.02 * rng.standard_normal(len(b)))
    rows = np.column_stack([b, c, amplitude])
    np.savetxt(tmp_path / "tilt.csv", rows, delimiter=",", header="b_deg,c_deg,amplitude_pct", comments="")
    assert echobase("calibrate", "tilt", tmp_path / "tilt.csv", "-o", tmp_path / "patch.json", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    patch = json.loads((tmp_path / "patch.json").read_text())
    loss = patch["probe"]["tilt_loss_db_per_deg2"]
    assert said["patch"] == patch
    assert abs(loss["b"] - 1.7) < 0.1
    assert abs(loss["c"] - 0.8) < 0.1


def test_a_backup_becomes_a_robot_that_plans(tmp_path, capsys, monkeypatch):
    machine = MACHINE.replace("#KR16L6_2 FLR", "#KR17X9 FLR")  # a robot that is not among the shipped ones
    assert machine != MACHINE
    (tmp_path / "$machine.dat").write_text(machine)
    (tmp_path / "$config.dat").write_text(CONFIG)
    files = (tmp_path / "$machine.dat", tmp_path / "$config.dat")
    assert echobase("robot", *files, "-o", tmp_path / "robots", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["tools"]
    assert said["bases"]
    part = write_stl(tmp_path / "plate.stl", *plane().mesh(3, 3))
    setup = {"robot": said["robot"], "base": {"x_mm": 1050, "z_mm": 500}, "tool": {"tcp": {"z_mm": 150}}}
    (tmp_path / "setup.json").write_text(json.dumps(setup))
    args = ("plan", part, "--unit", "mm", "--setup", tmp_path / "setup.json", "-o", tmp_path / "out")
    assert echobase(*args) == 1
    assert said["robot"] in capsys.readouterr().err
    monkeypatch.setenv("ECHOBASE_ROBOTS", str(tmp_path / "robots"))
    assert echobase(*args, "--json") == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["inspection"]["checks"]["robot"] == said["robot"]


def test_files_that_are_no_backup(tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("hello")
    assert echobase("robot", tmp_path / "notes.txt", "-o", tmp_path / "robots") == 1
    assert "$machine.dat" in capsys.readouterr().err
