"""`point_cloud`: recorded scans -> usable readings in the nominal base, whatever BASE was active."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from alignment.cloud import PointCloud
from alignment.pass_ids import pass_ids
from alignment.scan import Scan, SurfacePoints
from planner.couplant import distance_mm
from planner.errors import fail
from planner.frames import Array, Transform
from planner.issues import Issue
from planner.probe import law_offsets_mm, tool_axes
from planner.setup import Setup

BaseChoice = Literal["file", "nominal", "corrected"]


def point_cloud(
    scans: Sequence[Scan | SurfacePoints],
    setup: Setup,
    base: BaseChoice = "file",
    T_world_corrected: Transform | None = None,
) -> PointCloud:
    """Return all usable readings of the scans as one cloud in the nominal `base`.

    base: the BASE that was active in files that do not say it themselves; `corrected` needs `T_world_corrected`
    (`T_world_basecorr`). Readings that cannot be used are left out and counted in `issues`; the echoes lost are kept
    apart. Fails if nothing is left, if a law is not one of the probe's, or if laser points and echoes are mixed.
    """
    if not scans:
        raise fail("no-scan", "no scan was given.", "Give at least one scan file.")
    kinds = {isinstance(scan, SurfacePoints) for scan in scans}
    if len(kinds) > 1:
        raise fail(
            "scan-mixed",
            "ultrasonic readings and ready surface points cannot be mixed.",
            "Align them one after the other.",
        )
    pieces: list[dict[str, Any]] = []
    issues: list[Issue] = []
    poses = passes = 0
    for scan_id, scan in enumerate(scans):
        issues += scan.issues
        T_base_scan, said = _active_base(scan, setup, base, T_world_corrected)
        issues += said
        if isinstance(scan, SurfacePoints):
            piece, n_poses = _surface_points(scan, T_base_scan), len(scan)
        else:
            piece, dropped = _readings(scan, T_base_scan, setup)
            issues += dropped
            n_poses = len(scan.Ts_scan_tcp)
        for key in ("pose_index", "lost_pose_index"):
            piece[key] += np.int32(poses)
        for key in ("pass_id", "lost_pass_id"):
            piece[key] += np.int32(passes)
        piece["scan_id"] = np.full(len(piece["distance_mm"]), scan_id, dtype=np.int32)
        poses += n_poses
        passes = 1 + max(int(piece["pass_id"].max(initial=-1)), int(piece["lost_pass_id"].max(initial=-1)))
        pieces.append(piece)
    arrays: dict[str, Any] = {}
    for key in pieces[0]:
        values = [piece[key] for piece in pieces]
        arrays[key] = None if values[0] is None else values[0] if len(values) == 1 else np.concatenate(values)
    cloud = PointCloud(**arrays, total_readings=sum(len(scan) for scan in scans), issues=tuple(issues))
    if len(cloud) == 0:
        raise fail(
            "no-usable-reading",
            "not one reading of the scan can be used.",
            "See the issues of the scan; check gate and delay.",
            ", ".join(scan.name for scan in scans),
        )
    return cloud


def _active_base(
    scan: Scan | SurfacePoints, setup: Setup, base: BaseChoice, T_world_corrected: Transform | None
) -> tuple[Transform, list[Issue]]:
    """Return `T_base_scan` and what there is to say about it."""
    chosen: Transform | None = None
    if base == "corrected":
        if T_world_corrected is None:
            raise fail(
                "no-corrected-base",
                "the scan is said to be taken in the corrected BASE, but there is no correction yet.",
                "Align a scan taken in the nominal BASE first, or do not say that this one was taken in the corrected BASE.",
                scan.name,
            )
        chosen = Transform("world", "scan", T_world_corrected.rigid)
    nominal = Transform("world", "scan", setup.T_world_base.rigid)
    active = scan.T_world_scan
    issues = []
    if active is None:
        active = nominal if chosen is None else chosen
    elif base != "file":
        asked = nominal if chosen is None else chosen
        off = asked.inv() @ Transform("world", "base", active.rigid)
        if np.linalg.norm(off.xyz_mm) > 0.01 or float(off.angle_deg()) > 0.01:
            issues.append(
                Issue(
                    "warning",
                    "base-contradicts-file",
                    f"the file says in which BASE it was taken, and it is not the {base} one; the file was believed.",
                    "Remove the base_* columns if they are wrong.",
                    scan.name,
                )
            )
    return setup.T_world_base.inv() @ active, issues


def _readings(scan: Scan, T_base_scan: Transform, setup: Setup) -> tuple[dict[str, Any], list[Issue]]:
    Ts_base_tcp = T_base_scan @ scan.Ts_scan_tcp @ tool_axes(setup.tool)
    laws = setup.probe.laws
    if len(scan) and int(scan.law.max()) > laws:
        worst = int(scan.law.max())
        raise fail(
            "law-unknown",
            f"column 'law' goes up to {worst}, but the probe has {laws} law(s).",
            "Set probe.elements and probe.aperture_elements of setup.json to those of the scan.",
            scan.name,
        )
    rotation, xyz = Ts_base_tcp.rotation_matrix, Ts_base_tcp.xyz_mm
    array, beam = np.ascontiguousarray(rotation[:, :, 0]), np.ascontiguousarray(rotation[:, :, 2])
    back = xyz - setup.probe.face_offset_mm * beam
    offsets = law_offsets_mm(setup.probe)

    def origins(pose: NDArray[np.int32], law: NDArray[np.int32]) -> Array:
        out = array[pose]
        out *= offsets[law - 1][:, None]
        out += back[pose]
        return out

    distance = distance_mm(scan.tof_us, setup.couplant)
    heard = np.isfinite(distance)
    usable = heard & (distance > 0.0)
    lost_pose, lost_law = _lost(scan, heard, laws)
    reading_pass = _passes(scan, xyz)
    behind = int(np.count_nonzero(heard & ~usable))
    silent = int(np.count_nonzero(~heard))
    issues = []
    if silent:
        issues.append(Issue("info", "echoes-lost", f"{silent} of {len(scan)} readings have no echo.", "", scan.name))
    if behind:
        issues.append(
            Issue(
                "warning",
                "distance-negative",
                f"{behind} readings were dropped: their time of flight is not longer than the delay.",
                "Check couplant.delay_us.",
                scan.name,
            )
        )
    index: Any = slice(None) if usable.all() else np.flatnonzero(usable)
    pose, law = scan.pose_index[index].copy(), scan.law[index]
    pass_of_pose = np.zeros(len(xyz), dtype=np.int32)
    pass_of_pose[scan.pose_index] = reading_pass
    return {
        "origins_base": origins(pose, law),
        "beams_base": beam[pose],
        "arrays_base": array[pose],
        "distance_mm": distance[index],
        "amplitude_pct": scan.amplitude_pct[index],
        "law": law,
        "pose_index": pose,
        "pass_id": reading_pass[index].copy(),
        "lost_origins_base": origins(lost_pose, lost_law),
        "lost_beams_base": beam[lost_pose],
        "lost_pose_index": lost_pose,
        "lost_law": lost_law,
        "lost_pass_id": pass_of_pose[lost_pose],
    }, issues


def _passes(scan: Scan, xyz_mm: Array) -> NDArray[np.int32]:
    """Return the pass of each reading (n,), from 0 if the file does not number them."""
    if scan.pass_id is not None:
        return scan.pass_id.astype(np.int32)
    t_pose = None
    if scan.t_s is not None:
        t_pose = np.zeros(len(xyz_mm))
        t_pose[scan.pose_index[::-1]] = scan.t_s[::-1]
    return pass_ids(xyz_mm, t_pose)[scan.pose_index]


def _lost(scan: Scan, heard: NDArray[np.bool_], laws: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return pose and law of every echo lost: said so by the file, or missing among the rows of its pose.

    Rows that are not there can be told only where one pose carries a whole sweep: with most laws present on average.
    """
    m = len(scan.Ts_scan_tcp)
    if len(scan) <= 0.5 * m * laws:
        return scan.pose_index[~heard].copy(), scan.law[~heard]
    present = np.zeros(m * laws, dtype=bool)
    key = scan.pose_index.astype(np.int64) * laws + (scan.law - 1)
    present[key[heard]] = True
    lost = np.flatnonzero(~present)
    return (lost // laws).astype(np.int32), (lost % laws + 1).astype(np.int32)


def _surface_points(scan: SurfacePoints, T_base_scan: Transform) -> dict[str, Any]:
    n = len(scan)
    none, no_direction = np.zeros(0, dtype=np.int32), np.zeros((0, 3))
    return {
        "origins_base": T_base_scan.points(scan.points_scan),
        "beams_base": None,
        "arrays_base": None,
        "distance_mm": np.zeros(n),
        "amplitude_pct": np.full(n, np.nan) if scan.amplitude_pct is None else scan.amplitude_pct,
        "law": np.ones(n, dtype=np.int32),
        "pose_index": np.arange(n, dtype=np.int32),
        "pass_id": np.zeros(n, dtype=np.int32),
        "lost_origins_base": no_direction,
        "lost_beams_base": no_direction,
        "lost_pose_index": none.copy(),
        "lost_law": none,
        "lost_pass_id": none.copy(),
    }
