"""Plan -> KRL text -> a scanner over an analytic surface -> align -> corrected KRL -> the scanner again.

The scanner (`analytic_scanner`) reads the programs with regular expressions and knows the part as a formula; nothing of
EchoBase's geometry, reader or simulator is in it. BASE is taught and not zero, the placement is no identity, CAD frames
are turned, units differ: an inverse, a wrong side, a mixed-up axis or unit is millimetres off here.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.loop.analytic_scanner import matrix, normal_error_mm, run_program, scan, write_csv
from tests.loop.chain import echobase, error_at_face, part_in_base, pose, read, six, write
from tests.loop.surfaces import cylinder, double_curved, plane, wing, write_stl

BASE = {"x_mm": 1050, "y_mm": -80, "z_mm": 400, "a_deg": 12, "b_deg": 0.5, "c_deg": -0.4}
TCP = {"tcp": {"z_mm": 180}}


def placed_upright(T_cad, around):
    """Placement (six) that undoes the turn of the CAD frame, plus a small pose of its own."""
    m = matrix(np.asarray(around, float)) @ np.linalg.inv(T_cad)
    return [*m[:3, 3], *Rotation.from_matrix(m[:3, :3]).as_euler("ZYX", degrees=True)]


def plan(folder, surface, T_cad, unit, setup, mesh):
    """Write STL and setup, run `echobase plan`."""
    vertices, faces = surface.mesh(*mesh)
    vertices = vertices @ T_cad[:3, :3].T + T_cad[:3, 3]
    write_stl(folder / "part.stl", vertices, faces, {"mm": 1.0, "cm": 0.1, "m": 0.001, "inch": 1 / 25.4}[unit])
    write(folder / "setup.json", setup)
    args = ("plan", folder / "part.stl", "--unit", unit, "--setup", folder / "setup.json", "-o", folder / "out")
    assert echobase(*args) == 0


def aligned(folder, surface, T_base_part, setup, *options, kind="alignment", seed=0, **scanner):
    """Scan on the analytic truth, align, return correction.json."""
    rows = scan(folder / "out" / kind, surface, T_base_part, setup, seed=seed, **scanner)
    write_csv(folder / "scan.csv", rows)
    assert echobase("align", folder / "out", folder / "scan.csv", *options) == 0
    return read(folder / "out" / "correction" / "correction.json")


def test_flat_plate_surface_only_reaches_the_paper_and_holds_what_it_cannot_know(tmp_path):
    surface, offset, placement = plane(), [1.1, -0.7, 1.0, 0.2, -0.8, 0.5], [20, 15, 5, 3, 0, 0]
    setup = {"base": BASE, "placement": pose(placement), "tool": TCP}
    plan(tmp_path, surface, np.eye(4), "mm", setup, (2, 2))
    T_base_part = part_in_base(placement, offset)
    found = aligned(tmp_path, surface, T_base_part, setup, "--no-edges", kind="inspection", pose_mm=0.012)
    centre = (matrix(np.array(placement, float)) @ [75, 50, 0, 1])[:3]
    height, tilt = error_at_face(six(found["correction"]), offset, centre, np.array([0, 0, 1.0]))
    assert height < 0.02
    assert tilt < 0.01
    assert {k: v["status"] for k, v in found["dof"].items()} == {
        "x": "held", "y": "held", "z": "measured", "a": "held", "b": "measured", "c": "measured",
    }  # fmt: skip
    assert found["verdict"] == "pass"


def test_flat_plate_with_edges_finds_all_six(tmp_path):
    surface, offset, placement = plane(), [1.1, -0.7, 1.0, 0.2, -0.8, 0.5], [20, 15, 5, 3, 0, 0]
    setup = {"base": BASE, "placement": pose(placement), "tool": TCP}
    plan(tmp_path, surface, np.eye(4), "mm", setup, (2, 2))
    found = aligned(tmp_path, surface, part_in_base(placement, offset), setup, pose_mm=0.012, pose_deg=0.002)
    error = np.abs(six(found["correction"]) - offset)
    sigma = np.array([found["dof"][k]["sigma"] for k in "xyzabc"])
    assert (error < 4 * sigma).all()
    assert not any(d["status"] == "held" for d in found["dof"].values())
    assert error[2] < 0.05
    assert (error[4:] < 0.02).all()


CASES = {
    # A wing in inches, CAD frame turned and far off; another array, reversed, 6 mm behind the TCP; cold water; tool along +X.
    "wing-inch": (
        wing(), (220, 80), [200, -300, 120, 35, 20, -15], "inch", [1.0, -1.5, 1.2, 0.4, -0.2, 0.5],
        {
            "base": {"x_mm": 900, "y_mm": -530, "z_mm": 390, "a_deg": 5, "b_deg": 2, "c_deg": -3},
            "tool": {"tcp": {"z_mm": 220, "b_deg": -90}, "beam_axis": "x", "array_axis": "-y"},
            "couplant": {"temperature_c": 14.0},
            "probe": {"elements": 32, "pitch_mm": 1.0, "aperture_elements": 9, "reversed": True, "face_offset_mm": 6.0},
        }, 1463.2,
    ),
    # A panel in cm, upside down in its CAD, on an untaught base.
    "panel-cm-untaught": (
        double_curved(), (80, 50), [50, 20, 10, 90, 0, 180], "cm", [-1.5, 0.9, -2.0, -0.3, 0.2, -0.4], {}, 1482.3795,
    ),
    "cylinder-m": (
        cylinder(350.0, 420.0, 380.0), (30, 60), [0, 0, 0, 0, 0, 0], "m", [1.1, -0.7, 1.0, 0.2, -0.3, 0.5],
        {"base": {"x_mm": 900, "y_mm": -250, "z_mm": 200, "a_deg": 20}, "tool": TCP}, 1482.3795,
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_parts_and_cells_unlike_the_samples(tmp_path, case):
    surface, mesh, cad, unit, offset, setup, speed = CASES[case]
    T_cad = matrix(np.asarray(cad, float))
    placement = placed_upright(T_cad, [30, -20, 15, 7, 1.5, -2.0])
    setup = setup | {"placement": pose(placement)}
    plan(tmp_path, surface, T_cad, unit, setup, mesh)
    T_base_part = part_in_base(placement, offset, T_cad)
    found = aligned(tmp_path, surface, T_base_part, setup, c_m_s=speed)
    T_found = part_in_base(placement, six(found["correction"]), T_cad)
    assert normal_error_mm(surface, T_base_part, T_found) < 0.02
    error = np.abs(six(found["correction"]) - offset)
    assert (error < 4 * np.array([found["dof"][k]["sigma"] for k in "xyzabc"])).all()
    _corrected_program_follows_the_real_part(tmp_path / "out", setup, surface, T_base_part)


def _corrected_program_follows_the_real_part(folder, setup, surface, T_base_part):
    """Run the corrected text in the BASE that it sets: the TCP stands 15 mm off the real part, normal to it."""
    text = "\n".join(p.read_text(encoding="ascii") for p in (folder / "corrected").glob("*.src"))
    content = read(folder / "correction" / "correction.json")
    taught = any(setup.get("base", {}).get(k, 0.0) for k in ("x_mm", "y_mm", "z_mm", "a_deg"))
    assert ("BASE_DATA[1] = {" in text) == taught
    base = setup.get("base", {})
    nominal = matrix(np.array([base.get(k, 0.0) for k in ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")], float))
    T_base_active = np.linalg.inv(nominal) @ matrix(six(content["base"]))
    tool = setup.get("tool", {})
    beam_axis = tool.get("beam_axis", "z")
    poses = np.concatenate([p[on] for p, _, on in run_program(folder / "corrected")])
    T = np.linalg.inv(T_base_part) @ T_base_active @ np.array([matrix(p) for p in poses])
    u, v = surface.foot(T[:, :3, 3])
    normal = surface.normal(u, v)
    standoff = ((T[:, :3, 3] - surface.point(u, v)) * normal).sum(1)
    beam = T[:, :3, "xyz".index(beam_axis[-1])]
    tilt = np.degrees(np.arccos(np.clip(-(beam * normal).sum(1), -1, 1)))
    assert np.abs(standoff - 15.0).max() < 0.08
    assert tilt.max() < 0.1
    modules = {p.name: p.read_bytes() for p in (folder / "inspection").glob("*_0*.src")}
    assert modules
    assert all((folder / "corrected" / name).read_bytes() == data for name, data in modules.items())
