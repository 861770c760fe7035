"""Import of a robot's own backup, on files written for the test in the style of KSS data lists."""

import numpy as np
import pytest

from planner.errors import EchoBaseError
from planner.robot import forward, load_robot
from planner.robot.backup import read_backup
from planner.robot.load import parse_robot

MACHINE = r"""&ACCESS RVO
&REL 4
DEFDAT $MACHINE PUBLIC
CHAR $TRAFONAME[32]
$TRAFONAME[]="#KR16L6_2 FLR" ; name; with a semicolon
INT $NUM_AX
$NUM_AX=6 ;ACHSEN
ENUM MAIN_AXIS $MAIN_AXIS
$MAIN_AXIS=#NR
$WRIST_AXIS=#ZEH
REAL $LENGTH_A
$LENGTH_A=260.0 ;A1 - A2
$LENGTH_B = 680.000000
$TX3P3={X 970.0,Y 0.0,Z -35.0,A 0.0,B 90.0,C 0.0}
$TIRORO={FRAME: X 0.0,Y 0.0,Z 675.0,A 0.0,B 0.0,C 180.0}
$TFLWP={X 0.0,Y 0.0,Z 1.15E+02,A 0.0,B 0.0,C 0.0}
$ROBROOT={X 0.0,Y -20.5,Z 400.0,A 90.0,B 0.0,C 0.0}
REAL $SOFTN_END[12]
$SOFTN_END[1]=-185.0
$SOFTN_END[2]=-155.0
$SOFTN_END[3]=-130.0
$SOFTN_END[4]=-350.0
$SOFTN_END[5]=-130.0
$SOFTN_END[6]=-350.0
$SOFTP_END[1]=185.0
$SOFTP_END[2]=35.0
$SOFTP_END[3]=154.0
$SOFTP_END[4]=350.0
$SOFTP_END[5]=130.0
$SOFTP_END[6]=350.0
FRA $RAT_MOT_AX[12]
$RAT_MOT_AX[1]={N -125,D 1}
$RAT_MOT_AX[2]={N 125,D 1}
$VEL_AXIS_MA[1]=3250.0
$VEL_AXIS_MA[2]=3125
$VEL_AXIS_MA[3]=3000.0
ENDDAT
"""

CONFIG = r"""DEFDAT  $CONFIG PUBLIC
DECL FRAME TOOL_DATA[16]
DECL FRAME BASE_DATA[32]
TOOL_DATA[1]={X 10.5,Y 0.0,Z 251.75,A 0.0,B -90.0,C 0.0}
TOOL_DATA[2]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}
TOOL_NAME[1,]="PA nozzle"
BASE_DATA[1]={X 924.139893,Y 1099.00952,Z 527.833740,A -89.7931595,B 0.238999218,C -0.0562113412}
base_data[7]={x 1,y 2,z 3,a 4,b 5,c 6} ; in small letters
BASE_NAME[7,]="fixture 7"
DECL GLOBAL E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 90.0,A6 0.0,E1 0.0}
ENDDAT
"""


def files(machine: str = MACHINE, config: str = CONFIG) -> dict[str, bytes]:
    return {
        "backup/KRC/R1/Mada/$machine.dat": machine.replace("\n", "\r\n").encode("latin-1"),
        "backup\\KRC\\R1\\System\\$Config.dat": config.replace("\n", "\r\n").encode("latin-1"),
        "backup/KRC/R1/Program/main.src": b"DEF MAIN ( )\r\nEND\r\n",
    }


def test_the_robot_of_a_backup_is_the_one_shipped_under_its_name() -> None:
    backup = read_backup(files())
    axes = np.random.default_rng(1).uniform(-100, 100, (50, 6))
    shipped = load_robot("kuka-kr16-l6-2")
    assert np.abs(forward(backup.robot, axes).matrix - forward(shipped, axes).matrix).max() < 1e-9
    assert (backup.robot.limits_deg == shipped.limits_deg).all()
    assert backup.robot.name == "kr16l6-2-flr"


def test_axis_speeds_come_from_motor_speed_and_ratio() -> None:
    backup = read_backup(files())
    # 3,250 / min over 125 is 26 / min: 156 deg/s.
    assert backup.robot.speeds_deg_s[:2] == pytest.approx([156.0, 150.0])
    assert np.isnan(backup.robot.speeds_deg_s[2:]).all()
    assert any("A3, A4, A5, A6" in note for note in backup.notes)


def test_tools_bases_home_and_root() -> None:
    backup = read_backup(files())
    assert set(backup.tools) == {1}
    assert backup.tools[1].xyzabc() == (10.5, 0.0, 251.75, 0.0, -90.0, 0.0)
    assert backup.bases[1].xyzabc() == (924.139893, 1099.00952, 527.833740, -89.7931595, 0.238999218, -0.0562113412)
    assert backup.bases[7].xyzabc() == (1, 2, 3, 4, 5, 6)
    assert backup.home_deg.tolist() == [0, -90, 90, 0, 90, 0]
    assert backup.robot_root.xyzabc() == (0, -20.5, 400, 90, 0, 0)
    assert (backup.tool_names, backup.base_names) == ({1: "PA nozzle"}, {7: "fixture 7"})


def test_the_imported_robot_can_be_kept_as_a_file() -> None:
    robot = read_backup(files()).robot
    again = parse_robot(robot.file.model_dump_json(), "copy.json")
    assert again.file == robot.file


def test_a_wrist_above_the_forearm_has_the_other_sign() -> None:
    robot = read_backup(files(MACHINE.replace("Z -35.0", "Z 115.0"))).robot
    assert robot.file.opw.a2_mm == -115.0
    flange = forward(robot, [0, 0, 0, 0, 0, 0.0])
    assert flange.xyz_mm == pytest.approx([260 + 680 + 970 + 115, 0, 675 + 115])


def test_one_file_alone_is_enough_for_what_it_holds() -> None:
    both = files()
    machine = {k: v for k, v in both.items() if "machine" in k}
    config = {k: v for k, v in both.items() if "Config" in k}
    assert read_backup(machine).home_deg is None
    assert read_backup(config).robot is None
    assert any("$machine.dat" in note for note in read_backup(config).notes)


def test_the_second_machine_file_of_a_backup_does_not_hide_the_first() -> None:
    more = files() | {"backup/KRC/Steu/Mada/$machine.dat": b"DEFDAT $MACHINE\r\n$BRK_MAX_TM=200\r\nENDDAT\r\n"}
    assert read_backup(more).robot.file.opw.c3_mm == 970.0


@pytest.mark.parametrize(
    "machine, code, text",
    [
        (MACHINE.replace("$LENGTH_A", "$LENGTH_Q"), "backup-machine", "$LENGTH_A"),
        (MACHINE.replace("$SOFTP_END[4]", "$X[4]"), "backup-machine", "$SOFTP_END[4]"),
        (MACHINE.replace("$SOFTP_END[4]=350.0", "$SOFTP_END[4]=-351"), "backup-machine", "min_deg"),
        (MACHINE.replace("$LENGTH_B = 680.000000", "$LENGTH_B=0"), "backup-machine", "greater than 0"),
        (MACHINE.replace("#NR", "#SS"), "backup-kinematics", "articulated"),
        (MACHINE.replace("#ZEH", "#DSH"), "backup-kinematics", "spherical wrist"),
        (MACHINE.replace("$NUM_AX=6", "$NUM_AX=4"), "backup-kinematics", "4 axes"),
        (MACHINE.replace("{FRAME: X 0.0", "{FRAME: X 12.0"), "backup-kinematics", "$TIRORO"),
        ("\x00\x01binary", "backup-file", "text file"),
    ],
)
def test_what_cannot_be_used_is_said(machine: str, code: str, text: str) -> None:
    with pytest.raises(EchoBaseError) as error:
        read_backup(files(machine))
    assert error.value.issues[0].code == code
    assert text in str(error.value)


def test_a_frame_without_a_component_is_an_error_and_no_guess() -> None:
    with pytest.raises(EchoBaseError, match=r"BASE_DATA\[7\] has no C") as error:
        read_backup(files(config=CONFIG.replace(",c 6}", "}")))
    assert error.value.issues[0].code == "backup-frame"


def test_nothing_to_read() -> None:
    with pytest.raises(EchoBaseError, match="There is no"):
        read_backup({"main.src": b""})
