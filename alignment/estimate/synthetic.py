"""The readings a path would take of a perfect part where it is believed to be: the design of a scan before the scan."""

import numpy as np
from scipy.special import ndtr

from alignment.cloud import PointCloud
from alignment.estimate.edge_gain import MOST_DB
from alignment.estimate.edge_rows import EdgeMap
from alignment.metrics.figures import loss_db, tilts_deg
from planner.errors import fail
from planner.frames import Array
from planner.placement import assume_nominal
from planner.probe import law_origins_tcp
from planner.setup import Setup
from planner.surface.boundary import boundary
from planner.surface.curved import CurvedSurface
from planner.toolpath import ToolPath

# Echoes below this share of the plateau are not detected.
LEAST_SHARE = 0.04
MOST_READINGS = 120_000


def expected_cloud(path: ToolPath, curved: CurvedSurface, setup: Setup) -> PointCloud:
    """Return what the data poses of a path hear of the part on its nominal placement, without noise.

    Beyond an edge the echo fades on the beam's S-curve, and off the normal as the probe's tilt loss says; of dense paths
    some poses are left out.
    """
    data = path.take(path.is_data)
    laws = setup.probe.laws
    if len(data) == 0:
        raise fail("no-data-poses", "the path takes no data.", "Plan a path with data poses.", path.kind)
    step = max(1, int(np.ceil(len(data) * laws / MOST_READINGS)))
    data = data.take(np.arange(0, len(data), step))
    tcp = data.Ts_part_tcp
    m = len(data)
    rotation = tcp.rotation_matrix
    origins = np.einsum("mij,kj->mki", rotation, law_origins_tcp(setup.probe)) + tcp.xyz_mm[:, None]
    flat = origins.reshape(-1, 3)
    foot = curved.closest(flat)
    share = ndtr(-_beyond_mm(flat, foot.points, foot.normals, curved) / (setup.probe.beam_width_mm / 2.5))
    pose = np.repeat(np.arange(m, dtype=np.int32), laws)
    tilts = tilts_deg(rotation[:, :, 2][pose], rotation[:, :, 0][pose], foot.normals)
    share *= 10.0 ** (np.maximum(loss_db(*tilts, setup.probe), -MOST_DB) / 20.0)
    heard = share > LEAST_SHARE
    law = np.tile(np.arange(1, laws + 1, dtype=np.int32), m)
    T = assume_nominal(setup.T_base_partnom)
    base = T.points(flat)
    beams, arrays = (T.directions(rotation[:, :, k])[pose] for k in (2, 0))
    passes = data.pass_id[pose]
    lost = ~heard
    height = np.einsum("ij,ij->i", flat - foot.points, foot.normals)
    return PointCloud(
        base[heard], beams[heard], arrays[heard], height[heard], setup.reference_amplitude_pct * share[heard],
        law[heard], pose[heard], passes[heard], np.zeros(int(heard.sum()), dtype=np.int32), base[lost], pose[lost],
        law[lost], beams[lost], passes[lost], total_readings=len(flat),
    )  # fmt: skip


def _beyond_mm(origins: Array, points: Array, normals: Array, curved: CurvedSurface) -> Array:
    """Return how far beyond the nearest edge where the part ends the beams strike (n,), mm; negative on the part."""
    edges = EdgeMap(boundary(curved.surface))
    if len(edges) == 0:
        return np.full(len(origins), -np.inf)
    foot = origins - np.einsum("ij,ij->i", origins - points, normals)[:, None] * normals
    segment, nearest = edges.nearest(foot)
    off = foot - nearest
    outside = np.einsum("ij,ij->i", off, edges.conormal[segment]) > 0
    length = np.linalg.norm(off, axis=1)
    return np.where(outside, length, -length)
