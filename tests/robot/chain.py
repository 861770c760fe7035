"""An arm built link by link from URDF joints: independent of the closed form under test."""

import numpy as np
from scipy.spatial.transform import Rotation

# name -> joint origins (mm, in the parent link) of A1..A6 and the flange, as ros-industrial/kuka_experimental states them.
URDF_MM = {
    "kuka-kr16-2": [(0, 0, 675), (260, 0, 0), (680, 0, 0), (670, 0, -35), (0, 0, 0), (0, 0, 0), (158, 0, 0)],
    "kuka-kr16-r2010-2": [(0, 0, 520), (160, 0, 0), (980, 0, 0), (860, 0, 150), (0, 0, 0), (0, 0, 0), (153, 0, 0)],
    "kuka-kr20-r1810-2": [(0, 0, 520), (160, 0, 0), (780, 0, 0), (0, 0, 150), (860, 0, 0), (153, 0, 0), (0, 0, 0)],
    "kuka-kr6-r900-2": [(0, 0, 400), (25, 0, 0), (455, 0, 0), (0, 0, 25), (420, 0, 0), (90, 0, 0), (0, 0, 0)],
    "kuka-kr10-r1100-2": [(0, 0, 400), (25, 0, 0), (560, 0, 0), (515, 0, 25), (0, 0, 0), (90, 0, 0), (0, 0, 0)],
    "kuka-kr50-r2100": [(0, 0, 575), (175, 0, 0), (890, 0, 0), (0, 0, 50), (1035, 0, 0), (185, 0, 0), (0, 0, 0)],
    "kuka-kr60-ha": [(0, 0, 0), (350, 0, 815), (850, 0, 0), (465, 0, 145), (355, 0, 0), (170, 0, 0), (0, 0, 0)],
    "kuka-kr150-r3100-2": [(0, 0, 645), (330, 0, 0), (1350, 0, 0), (1420, 0, 115), (0, 0, 0), (215, 0, 0), (0, 0, 0)],
    "kuka-kr210-r3100-2": [(0, 0, 645), (330, 0, 0), (1350, 0, 0), (1420, 0, 115), (0, 0, 0), (240, 0, 0), (0, 0, 0)],
}
AXES = np.array([(0, 0, -1), (0, 1, 0), (0, 1, 0), (-1, 0, 0), (0, 1, 0), (-1, 0, 0)], dtype=float)
TOOL0 = Rotation.from_euler("Y", 90, degrees=True)

# KR 16 L6: modified Denavit-Hartenberg rows (alpha deg, a, d, theta0 deg) and axis signs of robotkinematicscatalogue 1.1.2.
MDH_L6 = [(0, 0, 675, 0), (-90, 260, 0, 0), (0, 680, 0, -90), (-90, -35, 970, 0), (90, 0, 0, 0), (-90, 0, 115, 180)]
SIGN_L6 = (-1, 1, 1, -1, 1, -1)


def urdf_flange(name: str, axes_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return position (3,), mm, and rotation (3, 3) of the flange in the robot's foot."""
    origins = np.asarray(URDF_MM[name], dtype=float)
    turn, at = Rotation.identity(), np.zeros(3)
    for origin, axis, angle in zip(origins[:6], AXES, axes_deg, strict=True):
        at = at + turn.apply(origin)
        turn = turn * Rotation.from_rotvec(np.radians(angle) * axis)
    return at + turn.apply(origins[6]), (turn * TOOL0).as_matrix()


def mdh_flange_l6(axes_deg: np.ndarray) -> np.ndarray:
    """Return the (4, 4) flange pose of the KR 16 L6 by its modified Denavit-Hartenberg rows (Craig)."""
    pose = np.eye(4)
    for (alpha, a, d, theta0), sign, angle in zip(MDH_L6, SIGN_L6, axes_deg, strict=True):
        ca, sa = np.cos(np.radians(alpha)), np.sin(np.radians(alpha))
        t = np.radians(theta0 + sign * angle)
        ct, st = np.cos(t), np.sin(t)
        pose = pose @ np.array(
            [[ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d], [0, 0, 0, 1]]
        )
    return pose
