"""What programs say: frames, first motion, signals, speeds, structure."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kuka_export.build import build_program
from kuka_export.export import export
from kuka_export.options import ProgramOptions
from kuka_export.reader import read_program
from kuka_export.writer import write_program
from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.issues import Issue
from planner.program_path import Motion
from planner.setup import Setup
from planner.toolpath import Role
from tests.krl.paths import CORRECTION, PATHS, correction, cylinder, raster, setup

CONTROLLERS = ("krc2", "krc4", "krc5")


def texts(files: dict[str, bytes]) -> str:
    return "".join(data.decode("ascii") for data in files.values())


def lines(files: dict[str, bytes], name: str) -> list[str]:
    return files[name].decode("ascii").split("\r\n")


def codes(error: EchoBaseError) -> set[str]:
    return {i.code for i in error.issues}


def rz(deg: float) -> np.ndarray:
    return hom(Rotation.from_euler("Z", deg, degrees=True).as_matrix(), (0, 0, 0))


def hom(rotation: np.ndarray, xyz: tuple[float, float, float]) -> np.ndarray:
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = rotation, xyz
    return m


def flange_kr16_l6(axes: np.ndarray) -> np.ndarray:
    """KR 16 L6-2 by hand, joint by joint: 675/260, 680, 970 with 35 below, 115; A1, A4, A6 turn the other way."""

    def ry(deg: float, xyz: tuple[float, float, float]) -> np.ndarray:
        return hom(Rotation.from_euler("Y", deg, degrees=True).as_matrix(), xyz)

    def rx(deg: float, xyz: tuple[float, float, float]) -> np.ndarray:
        return hom(Rotation.from_euler("X", deg, degrees=True).as_matrix(), xyz)

    a1, a2, a3, a4, a5, a6 = axes
    arm = (
        rz(-a1)
        @ ry(a2, (260, 0, 675))
        @ ry(a3, (680, 0, 0))
        @ rx(-a4, (970, 0, -35))
        @ ry(a5, (0, 0, 0))
        @ rx(-a6, (0, 0, 0))
    )
    return arm @ ry(90, (115, 0, 0))


def test_the_hand_written_arm_stands_where_kuka_says():
    home = flange_kr16_l6(np.array([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(home[:3, 3], [1345.0, 0.0, 1320.0], atol=1e-9)


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("kind", PATHS)
def test_three_parts_export_for_every_controller(controller: str, kind: str):
    made = export(PATHS[kind], setup(controller), "EB_JOB", kind)
    assert made.proof.ok
    assert made.proof.poses == len(PATHS[kind])
    assert made.proof.largest_mm <= 0.0005
    assert made.proof.largest_deg <= 0.00005


@pytest.mark.parametrize("corrected", [False, True])
def test_first_axis_values_put_the_tool_on_the_first_pose(corrected: bool):
    s = setup()
    made = export(cylinder(), s, "EB_JOB", T_base_basecorr=correction() if corrected else None)
    reading = read_program(made.files)
    tool = hom(Rotation.from_euler("ZYX", [90, 0, 0], degrees=True).as_matrix(), (5.0, -3.0, 210.0))
    got = flange_kr16_l6(reading.first_axes) @ tool
    want = reading.T_world_base.matrix @ reading.path.Ts_base_tcp.matrix[0]
    np.testing.assert_allclose(got[:3, 3], want[:3, 3], atol=0.02)
    np.testing.assert_allclose(got[:3, :3], want[:3, :3], atol=1e-5)


def test_poses_are_those_of_the_part_in_the_program_base_with_the_tool_as_taught():
    s = setup(tool={"number": 2, "beam_axis": "x", "array_axis": "-z", "tcp": {"z_mm": 100.0}})
    path = cylinder()
    got = read_program(export(path, s, "EB_JOB").files).path.Ts_base_tcp
    placement = Transform.from_xyzabc("base", "part", [40.0, -25.0, 8.0, 4.0, 1.0, -2.0])
    tcp = placement @ path.Ts_part_tcp
    # The taught tool's +X is the beam, its -Z the array axis.
    np.testing.assert_allclose(got.rotation_matrix[:, :, 0], tcp.rotation_matrix[:, :, 2], atol=3e-6)
    np.testing.assert_allclose(-got.rotation_matrix[:, :, 2], tcp.rotation_matrix[:, :, 0], atol=3e-6)
    np.testing.assert_allclose(got.xyz_mm, tcp.xyz_mm, atol=5.1e-4)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_taught_base_is_assigned_before_the_first_motion_and_nowhere_in_motion_modules(controller: str):
    made = export(PATHS["plane"], setup(controller), "EB_JOB")
    assert texts(made.files).count("BASE_DATA[3] = {X 900.000,Y -120.000,Z 410.000,A 12.0000,B -1.5000,C 0.7000}") == 1
    assert "BASE_DATA[3] = {" in made.files["EB_JOB_BASE.src"].decode()
    main = lines(made.files, "EB_JOB.src")
    first = next(i for i, t in enumerate(main) if t.startswith(("PTP ", "SPTP ")))
    assert main.index("EB_JOB_BASE ( )") < main.index("$BASE = BASE_DATA[3]") < first
    assert main.index(";ENDFOLD (INI)") < main.index("EB_JOB_BASE ( )")
    assert re.match(r"S?PTP \{A1 -?\d", main[first])
    assert "XHOME" not in texts(made.files)
    assert main.count("$TOOL = TOOL_DATA[5]") == 1
    assert not re.search(r"TOOL_DATA\[\d+\] *=", texts(made.files))


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_an_untaught_base_starts_at_home_and_is_never_written(controller: str):
    made = export(PATHS["plane"], setup(controller, taught=False), "EB_JOB", T_base_basecorr=correction())
    text = texts(made.files)
    main = lines(made.files, "EB_JOB_C.src")
    assert next(t for t in main if t.startswith(("PTP ", "SPTP "))) == "PTP XHOME"
    assert "$BASE = BASE_DATA[3] : {X 1.100,Y -0.700,Z 1.000,A 0.2000,B -0.8000,C 0.5000}" in main
    assert not re.search(r"BASE_DATA\[\d+\] *= *[{B]", text)
    assert "{A1" not in text
    assert read_program(made.files).base_offset == pytest.approx(CORRECTION)


def test_the_corrected_base_is_the_nominal_times_the_correction_and_may_have_its_own_number():
    s = setup()
    s = s.model_copy(update={"base": s.base.model_copy(update={"corrected_number": 9})})
    made = export(PATHS["plane"], s, "EB_JOB", T_base_basecorr=correction())
    reading = read_program(made.files)
    m = hom(Rotation.from_euler("ZYX", [12.0, -1.5, 0.7], degrees=True).as_matrix(), (900.0, -120.0, 410.0))
    c = hom(Rotation.from_euler("ZYX", CORRECTION[3:], degrees=True).as_matrix(), CORRECTION[:3])
    np.testing.assert_allclose(reading.T_world_base.matrix, m @ c, atol=6e-4)
    assert (reading.base_number, set(reading.base_data)) == (9, {9})
    text = made.files["EB_JOB_C_BASE.src"].decode()
    assert "BASE_DATA[3] : {X 1.100,Y -0.700,Z 1.000,A 0.2000,B -0.8000,C 0.5000}" in text
    assert ";NOMINAL  {X 900.000,Y -120.000,Z 410.000,A 12.0000,B -1.5000,C 0.7000}" in text


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("taught", [True, False])
@pytest.mark.parametrize("motion", [None, "lin"])
def test_a_correction_changes_the_base_and_nothing_else(controller: str, taught: bool, motion: str | None):
    s, options = setup(controller, taught), ProgramOptions(motion=motion)
    nominal = export(PATHS["wave"], s, "EB_JOB", options=options)
    corrected = export(
        PATHS["wave"], s, "EB_JOB", "another label", T_base_basecorr=correction(), options=options, notes=("n",)
    )
    motion_files = {n for n in nominal.files if re.search(r"_\d{3}\.src$", n)}
    assert motion_files
    assert {n: nominal.files[n] for n in motion_files} == {n: corrected.files[n] for n in motion_files}
    np.testing.assert_array_equal(read_program(nominal.files).poses, read_program(corrected.files).poses)


def test_adapted_poses_get_modules_of_their_own():
    plain = export(PATHS["plane"], setup(), "EB_JOB")
    adapted = export(
        PATHS["plane"], setup(), "EB_JOB", T_base_basecorr=correction(), options=ProgramOptions(adapted=True)
    )
    assert not plain.files.keys() & adapted.files.keys()


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("signal", ["trigger", "pulse", "none"])
@pytest.mark.parametrize("motion", [None, "lin"])
def test_data_are_taken_from_the_first_to_the_last_data_pose(controller: str, signal: str, motion: str | None):
    path = PATHS["wave"]
    made = export(path, setup(controller), "EB_JOB", options=ProgramOptions(signal=signal, motion=motion))
    reading = read_program(made.files)
    data = path.role == Role.DATA
    before = np.concatenate([[False], data[:-1]]) & np.concatenate([[False], path.pass_id[1:] == path.pass_id[:-1]])
    np.testing.assert_array_equal(reading.path.data_on, data & before)
    np.testing.assert_array_equal(reading.path.pass_id, path.pass_id)
    assert reading.data_source == {"none": "comment"}.get(signal, signal)
    switching = [t for t in texts(made.files).split("\r\n") if t.startswith("TRIGGER")]
    assert len(switching) == (0 if signal == "none" else 2 * path.passes)
    form = "DISTANCE=1" if controller == "krc2" else "PATH=0"
    assert all(t.startswith(f"TRIGGER WHEN {form} DELAY=0 DO ") for t in switching)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_long_passes_become_blocks_without_a_gap_in_the_data(controller: str):
    path = raster(data=331, passes=2, step=2.0)
    made = export(path, setup(controller), "EB_JOB", options=ProgramOptions(segments=100))
    reading = read_program(made.files)
    if controller == "krc2":
        assert (reading.path.block == -1).all()
        return
    counts = np.bincount(reading.path.block[reading.path.block >= 0])
    assert counts.max() <= 100
    assert counts.min() >= 80
    assert reading.path.data_on.sum() == 2 * 330
    assert texts(made.files).count("TRIGGER") == 4
    inside = reading.path.block >= 0
    assert (reading.path.motion[inside] == Motion.SPL).all()
    assert (reading.path.motion[~inside] == Motion.LIN).all()


def test_krc4_uses_the_spline_family_only_after_its_first_motion():
    for motion in (None, "lin"):
        made = export(PATHS["wave"], setup("krc4"), "EB_JOB", options=ProgramOptions(home=True, motion=motion))
        words = [
            t.split()[0]
            for n in sorted(made.files)
            if n.endswith(".src")
            for t in lines(made.files, n)
            if re.match(r"[A-Z_]+ ([{X])", t)
        ]
        assert words.count("PTP") == 1
        assert not set(words) & {"LIN", "CIRC"}
        assert texts(made.files).count("SPTP XHOME") == 1


def test_krc2_uses_lin_only_and_declares_what_it_calls():
    made = export(PATHS["wave"], setup("krc2"), "EB_JOB")
    main = lines(made.files, "EB_JOB.src")
    assert {"EXT EB_JOB_BASE ( )", "EXT EB_JOB_001 ( )"} <= set(main)
    assert not re.search(r"\b(SLIN|SPTP|SPL|SPLINE)\b", texts(made.files))
    assert "EXT EB" not in texts(export(PATHS["wave"], setup("krc4"), "EB_JOB").files)


def test_blending_is_at_most_half_the_closest_spacing():
    made = export(raster(step=1.3), setup("krc2"), "EB_JOB")
    assert "$APO.CDIS = 0.65" in lines(made.files, "EB_JOB.src")


def test_waits_stand_before_every_pass_and_are_read_back():
    made = export(PATHS["plane"], setup(signals={"data_output": 2, "wait_input": 11}), "EB_JOB")
    assert (
        texts(made.files).count("WAIT FOR $IN[11]==TRUE\r\nSLIN")
        + texts(made.files).count("WAIT FOR $IN[11]==TRUE\r\n$VEL")
        == 3
    )
    assert len(read_program(made.files).waits) == 3


def test_speeds_of_scan_approach_and_links():
    options = ProgramOptions(approach_speed_mm_s=60.0, link_speed_mm_s=333.0)
    path = PATHS["wave"]
    reading = read_program(export(path, setup(alignment={"scan_speed_mm_s": 40}), "EB_JOB", options=options).files)
    speed = reading.path.speed_mm_s
    assert set(speed[path.role == Role.DATA]) == {40.0}
    assert set(speed[path.role == Role.LINK]) == {333.0}
    assert set(speed[path.role == Role.RETRACT]) == {60.0}


def test_repeated_poses_between_link_and_approach_are_dropped():
    path = PATHS["plane"]
    rows = np.repeat(np.arange(len(path)), np.where((path.role == Role.APPROACH) | (path.role == Role.LEAD_IN), 3, 1))
    made = export(path.take(rows), setup(), "EB_JOB")
    np.testing.assert_array_equal(
        read_program(made.files).poses, read_program(export(path, setup(), "EB_JOB").files).poses
    )


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"name": "bad-name"}, "krl-name"),
        ({"name": "A" * 17}, "krl-name"),
        ({"name": "LOOP"}, "krl-name"),
        ({"options": ProgramOptions(scan_speed_mm_s=3001.0)}, "krl-speed"),
        ({"options": ProgramOptions(link_speed_mm_s=9e9)}, "krl-speed"),
        (
            {"setup": setup("krc2").model_copy(update={"base": setup().base.model_copy(update={"number": 17})})},
            "krl-index",
        ),
        ({"setup": setup("krc2"), "options": ProgramOptions(motion="spline")}, "krl-motion"),
        ({"T": correction((14.0, 0, 0, 0, 3.0, 0))}, "correction-limit"),
        ({"T": correction((0, 0, 0, 3.51, 0, 0))}, "correction-limit"),
        ({"rows": slice(0, 0)}, "krl-empty"),
        ({"rows": np.array([0, 1, 2, 14, 15])}, "krl-short-data"),
        ({"rows": np.array([0, 1, 14, 15])}, "krl-no-data"),
        ({"rows": np.array([0, 1, 2, 3, 3, 4, 14, 15])}, "krl-repeated-pose"),
        ({"setup": setup(base={"number": 1, "x_mm": 9000.0})}, "robot-out-of-reach"),
        ({"options": ProgramOptions(load_bytes=20_000), "path": raster(data=400, passes=1, step=1.0)}, "krl-size"),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_faults_are_found_before_a_line_is_written(change: dict, code: str):
    path = change.get("path", raster())
    path = path.take(change["rows"]) if "rows" in change else path
    with pytest.raises(EchoBaseError) as caught:
        build_program(path, change.get("setup", setup()), change.get("name", "EB_JOB"), T_base_basecorr=change.get("T"),
                      options=change.get("options", ProgramOptions()), centroid_base_mm=[400.0, 0.0, 0.0])  # fmt: skip
    assert code in codes(caught.value)
    assert all(isinstance(i, Issue) and i.remedy for i in caught.value.issues)


def test_all_faults_come_at_once():
    far = setup().base.model_copy(update={"number": 30})
    with pytest.raises(EchoBaseError) as caught:
        build_program(raster(), setup("krc2").model_copy(update={"base": far}), "no good",
                      options=ProgramOptions(link_speed_mm_s=4000.0, motion="spline"))  # fmt: skip
    assert {"krl-name", "krl-index", "krl-speed", "krl-motion"} <= codes(caught.value)


def test_poses_that_are_not_numbers_never_become_text():
    path = raster()
    bad = path.standoff_mm.copy()
    bad[5] = np.nan
    with pytest.raises(EchoBaseError) as caught:
        build_program(
            type(path)(
                path.kind, path.Ts_part_contact, bad, path.heading, path.pass_id, path.role, path.face, path.bary
            ),
            setup(),
            "EB_JOB",
        )
    assert codes(caught.value) == {"krl-not-finite"}


def test_correction_limits_refuse_at_the_centroid_not_at_the_origin():
    far = correction((0.0, 0.0, 0.0, 2.0, 0.0, 0.0))  # 2 deg about Z moves a point 400 mm away by 13.96 mm, 450 by 15.7
    build_program(raster(), setup(), "EB_JOB", T_base_basecorr=far, centroid_base_mm=[400.0, 0.0, 0.0])
    with pytest.raises(EchoBaseError):
        build_program(raster(), setup(), "EB_JOB", T_base_basecorr=far, centroid_base_mm=[450.0, 0.0, 0.0])


def test_verdicts():
    with pytest.raises(EchoBaseError, match="failed"):
        export(raster(), setup(), "EB_JOB", T_base_basecorr=correction(), verdict="fail", acceptance="me")
    with pytest.raises(EchoBaseError, match="partial"):
        export(raster(), setup(), "EB_JOB", T_base_basecorr=correction(), verdict="partial")
    made = export(
        raster(),
        setup(),
        "EB_JOB",
        T_base_basecorr=correction(),
        verdict="partial",
        acceptance="A. Person: Z and B suffice",
    )
    assert ";NOTE ACCEPTANCE: A. Person: Z and B suffice" in lines(made.files, "EB_JOB_C.src")
    assert made.manifest["acceptance"].startswith("A. Person")


def test_the_manifest_counts_what_the_files_hold():
    made = export(raster(), Setup(), "EB_JOB", "p")
    assert made.manifest["bytes"] == sum(f["bytes"] for f in made.manifest["files"].values()) == len(texts(made.files))
    assert made.manifest["poses"] == 48
    assert made.manifest["limits"]["used_bytes"] <= made.manifest["limits"]["load_bytes"]
    assert write_program(made.program) == made.files
