"""`calibrate`: files in, calibration out; what the command and the page call."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from alignment.calibrate.couplant import calibrate_couplant
from alignment.calibrate.result import Calibration, Kind, Target
from alignment.calibrate.sphere import calibrate_tcp_sphere
from alignment.calibrate.tables import read_table
from alignment.calibrate.tcp import calibrate_tcp
from alignment.calibrate.tilt import calibrate_tilt
from alignment.readers import read_scan
from alignment.scan import Scan
from planner.errors import fail
from planner.frames import Array
from planner.setup import Setup


def calibrate(
    kind: Kind,
    paths: list[Path],
    setup: Setup,
    target: Target = "plane",
    radius_mm: float | None = None,
    names: list[str] | None = None,
) -> Calibration:
    """Return the calibration of files.

    tilt: CSV with b_deg, c_deg, amplitude_pct. couplant: CSV with tof_us, gap_mm or step_mm, and optionally echo (1, 2,
    ...). tcp: a scan of a fixed target in any scan format: a plane, or a sphere of radius_mm (None: to be found). Several
    files of a kind are taken together (tcp: one scan, which may be of two files). names: what people call the files.
    Raises EchoBaseError; `calibration-target` for a sphere that is to calibrate anything but the TCP.
    """
    if kind != "tcp" and (target != "plane" or radius_mm is not None):
        raise fail(
            "calibration-target", "A sphere calibrates the TCP only.", "Leave target and radius out, or calibrate tcp."
        )
    labels = [path.name for path in paths] if names is None else names
    if not paths:
        raise fail("calibration-file", "There is no file to calibrate from.", "Name at least one.")
    if kind == "tcp":
        scan = read_scan(paths, labels)
        if not isinstance(scan, Scan):
            raise fail(
                "calibration-file", "A point cloud does not show the probe.", "Use ultrasonic readings with poses."
            )
        on_plane = target == "plane" and radius_mm is None
        found = calibrate_tcp(scan, setup) if on_plane else calibrate_tcp_sphere(scan, setup, radius_mm)
        return replace(found, simulated=scan.simulated)
    if kind == "tilt":
        columns = _joined(paths, labels, ("b_deg", "c_deg", "amplitude_pct"), ())
        return calibrate_tilt(columns["b_deg"], columns["c_deg"], columns["amplitude_pct"])
    if kind == "couplant":
        columns = _joined(paths, labels, ("tof_us",), ("gap_mm", "step_mm", "echo"))
        return calibrate_couplant(
            columns["tof_us"], setup.couplant, columns.get("gap_mm"), columns.get("step_mm"), columns.get("echo")
        )
    raise fail("calibration-kind", f"There is no calibration '{kind}'.", "Choose tilt, couplant or tcp.")


def _joined(
    paths: list[Path], labels: list[str], required: tuple[str, ...], optional: tuple[str, ...]
) -> dict[str, Array]:
    tables = [read_table(path, required, optional, label) for path, label in zip(paths, labels, strict=True)]
    names = set().union(*tables)
    for label, table in zip(labels, tables, strict=True):
        lacking = sorted(names - set(table))
        if lacking:
            raise fail(
                "calibration-file",
                f"The column {', '.join(lacking)} is in other files but not here.",
                "Add it.",
                label,
            )
    return {name: np.concatenate([table[name] for table in tables]) for name in sorted(names)}
