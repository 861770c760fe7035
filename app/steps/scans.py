"""Scan files to one point cloud."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from alignment.cloud import PointCloud
from alignment.point_cloud import point_cloud
from alignment.readers import read_scan
from alignment.scan import Scan, SurfacePoints
from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.setup import Setup


def read_scans(sources: Sequence[Path]) -> list[Scan | SurfacePoints]:
    """Return the scans of the files; two halves of one scan (poses, readings by time) may stand anywhere in the list."""
    scans: list[Scan | SurfacePoints] = []
    halves: list[Path] = []
    unpaired: EchoBaseError | None = None
    for source in sources:
        try:
            scans.append(read_scan([source]))
        except EchoBaseError as error:
            if error.issues[0].code != "scan-half":
                raise
            halves.append(source)
            unpaired = error
    if unpaired is not None:
        if len(halves) != 2:
            raise unpaired
        scans.append(read_scan(halves))
    return scans


def cloud_of(
    scans: Sequence[Scan | SurfacePoints],
    setup: Setup,
    base: Literal["nominal", "corrected"] | None,
    T_world_corrected: Transform | None,
) -> PointCloud:
    """Return the readings in the nominal base; `base` is for files that do not say which BASE was active."""
    return point_cloud(scans, setup, base or "file", T_world_corrected)
