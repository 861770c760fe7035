"""An ultrasonic scanner over an analytic surface: runs the KRL text by regular expressions, writes the readings CSV."""

import re
from pathlib import Path

import numpy as np
import polars as pl
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

FRAME = r"\{\s*(?:FRAME\s*:\s*)?X\s+(\S+?),\s*Y\s+(\S+?),\s*Z\s+(\S+?),\s*A\s+(\S+?),\s*B\s+(\S+?),\s*C\s+([-0-9.]+)"


def matrix(xyzabc):
    m = np.eye(4)
    m[:3, :3] = Rotation.from_euler("ZYX", xyzabc[3:], degrees=True).as_matrix()
    m[:3, 3] = xyzabc[:3]
    return m


def run_program(folder: Path):
    """Return [(poses (k, 6), is_spline, data_on (k,))] block by block, following the calls of the main module."""
    modules = {p.stem.upper(): p.read_text(encoding="ascii").splitlines() for p in folder.glob("*.src")}
    called = {name for lines in modules.values() for line in lines for name in re.findall(r"^\s*(\w+)\s*\(\s*\)", line)}
    mains = [
        m
        for m, lines in modules.items()
        if any(re.match(r"\s*(\w+)\s*\(\s*\)\s*$", x) for x in lines) and m not in called
    ]
    assert len(mains) == 1, mains
    blocks, state = [], {"on": False, "next": None, "here": None}

    def pose(line):
        found = re.search(FRAME, line)
        return [float(x) for x in found.groups()] if found else None

    def walk(name):
        spline = None
        for raw in modules[name]:
            line = raw.split(";")[0].strip()
            call = re.match(r"^(\w+)\s*\(\s*\)$", line)
            if call and call.group(1).upper() in modules:
                walk(call.group(1).upper())
            elif re.match(r"^SPLINE\b", line):
                spline = [[state["here"]], [False]]
            elif line.startswith("ENDSPLINE"):
                blocks.append((np.array(spline[0]), True, np.array(spline[1])))
                spline = None
            elif line.startswith("TRIGGER"):
                value = "=TRUE" in line.replace(" ", "").upper()
                at_start = "ONSTART" in line or re.search(r"DISTANCE\s*=\s*0", line)
                if at_start:
                    state["on"] = value
                else:
                    state["next"] = value
            elif (p := pose(line)) and re.match(r"^(SPL|SLIN|LIN|PTP|SPTP)\b", line):
                if spline is not None:
                    spline[0].append(p)
                    spline[1].append(state["on"])
                else:
                    blocks.append((np.array([state["here"] or p, p]), False, np.array([False, state["on"]])))
                if state["next"] is not None:
                    state["on"], state["next"] = state["next"], None
                state["here"] = p

    walk(mains[0])
    return blocks


def dense_poses(blocks, spacing):
    """Return the poses (m, 4, 4) every `spacing` mm where the data signal is on, and their pass numbers."""
    out, passes, count = [], [], 0
    for every, is_spline, signal in blocks:
        if not signal.any():
            continue
        keep = np.r_[True, np.linalg.norm(np.diff(every[:, :3], axis=0), axis=1) > 1e-9]
        poses, on = every[keep], signal[keep]
        s = np.r_[0, np.cumsum(np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1))]
        r = Rotation.from_euler("ZYX", poses[:, 3:], degrees=True)
        runs = np.flatnonzero(np.diff(np.r_[0, on.astype(int), 0])).reshape(-1, 2)
        for first, last in runs:
            t = np.arange(s[first - 1], s[last - 1] + 1e-9, spacing)
            if is_spline and len(s) > 3:
                xyz, rot = CubicSpline(s, poses[:, :3])(t), RotationSpline(s, r)(t)
            else:
                xyz, rot = np.stack([np.interp(t, s, poses[:, i]) for i in range(3)], 1), Slerp(s, r)(t)
            m = np.tile(np.eye(4), (len(t), 1, 1))
            m[:, :3, :3], m[:, :3, 3] = rot.as_matrix(), xyz
            out.append(m)
            passes.append(np.full(len(t), count))
            count += 1
    return np.concatenate(out), np.concatenate(passes)


def correlated(rng, m, passes, spacing, length, width):
    """First-order Gauss-Markov noise along each pass, unit variance."""
    x = rng.standard_normal((m, width))
    rho = np.exp(-spacing / length)
    for i in range(1, m):
        if passes[i] == passes[i - 1]:
            x[i] = rho * x[i - 1] + np.sqrt(1 - rho**2) * x[i]
    return x


def axis(name):
    return (-1.0 if name[0] == "-" else 1.0) * np.eye(3)["xyz".index(name[-1])]


def scan(
    folder,
    surface,
    T_base_part,
    setup,
    seed=0,
    pose_mm=0.03,
    pose_deg=0.005,
    corr_mm=10.0,
    tof_mm=0.01,
    c_m_s=1482.3795,
    spacing=2.0,
):
    """Return the columns of a readings file: what a cell with this part at T_base_part (4, 4) would have recorded."""
    rng = np.random.default_rng(seed)
    T, passes = dense_poses(run_program(folder), spacing)
    probe = {
        "elements": 64,
        "pitch_mm": 0.6,
        "aperture_elements": 15,
        "beam_width_mm": 3.0,
        "reversed": False,
        "face_offset_mm": 0.0,
    }
    probe |= setup.get("probe", {})
    laws = 1 if probe["elements"] == 1 else probe["elements"] - probe["aperture_elements"] + 1
    x = (np.arange(1, laws + 1) - (laws + 1) / 2) * probe["pitch_mm"] * (-1 if probe["reversed"] else 1)
    noise = correlated(rng, len(T), passes, spacing, corr_mm, 6)
    actual = T.copy()
    actual[:, :3, 3] += pose_mm * noise[:, :3]
    actual[:, :3, :3] = Rotation.from_rotvec(np.radians(pose_deg) * noise[:, 3:]).as_matrix() @ T[:, :3, :3]
    # The tool as taught may name its axes otherwise: beam and array are looked up in it.
    tool = setup.get("tool", {})
    beam, array = (axis(tool.get(name, usual)) for name, usual in (("beam_axis", "z"), ("array_axis", "x")))
    P = np.linalg.inv(T_base_part) @ actual
    P[:, :3, :3] = P[:, :3, :3] @ np.stack([array, np.cross(beam, array), beam], axis=1)
    xa, ya, za = P[:, :3, 0], P[:, :3, 1], P[:, :3, 2]
    origin = (P[:, None, :3, 3] + x[None, :, None] * xa[:, None] - probe["face_offset_mm"] * za[:, None]).reshape(-1, 3)
    xa, ya, za = (np.repeat(a, laws, axis=0) for a in (xa, ya, za))
    u, v = surface.foot(origin)
    n = surface.normal(u, v)
    d = ((origin - surface.point(u, v)) * n).sum(1)
    tilt_b = np.degrees(np.arctan2((n * xa).sum(1), -(n * za).sum(1)))
    tilt_c = np.degrees(np.arctan2((n * ya).sum(1), -(n * za).sum(1)))
    loss = np.minimum(2.0 * tilt_b**2 + 1.0 * tilt_c**2, 40.0)
    # Share of a disc-shaped beam that falls on the part: points of the disc, projected along the normal. Each beam's are
    # turned by an angle of its own, and half of them mirror the others: no crossing is moved by where the points lie.
    half = 60
    k = np.arange(half)
    radius, angle = np.sqrt((k + 0.5) / half) * probe["beam_width_mm"] / 2, k * 2.399963
    radius, angle = np.r_[radius, radius], np.r_[angle, angle + np.pi]
    turn = rng.uniform(0.0, 2.0 * np.pi, len(origin))[:, None]
    share = np.zeros(len(origin))
    du, dv = surface.derivatives(u, v)
    guu, guv, gvv = (du * du).sum(1), (du * dv).sum(1), (dv * dv).sum(1)
    det = guu * gvv - guv**2
    for r, a in zip(radius, angle, strict=True):
        offset = r * np.cos(a + turn) * xa + r * np.sin(a + turn) * ya
        e, f = (offset * du).sum(1), (offset * dv).sum(1)
        share += surface.inside(u + (gvv * e - guv * f) / det, v + (guu * f - guv * e) / det)
    share /= len(radius)
    amplitude = 50.0 * 10 ** (-loss / 20) * share * (1 + 0.02 * rng.standard_normal(len(d)))
    tof = 2 * (d + tof_mm * rng.standard_normal(len(d))) / (c_m_s * 1e-3)
    lost = amplitude < 2.0
    pose = np.repeat(T[:, :3, 3], laws, axis=0)
    abc = np.repeat(Rotation.from_matrix(T[:, :3, :3]).as_euler("ZYX", degrees=True), laws, axis=0)
    return np.column_stack(
        [pose, abc, np.tile(np.arange(1, laws + 1), len(T)), np.where(lost, np.nan, tof), np.where(lost, 0, amplitude)]
    )


def write_csv(path: Path, rows) -> Path:
    names = ["x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg", "law", "tof_us", "amplitude_pct"]
    frame = pl.DataFrame(rows, schema=names, orient="row").with_columns(
        pl.col("law").cast(pl.Int32), pl.col("tof_us").fill_nan(None)
    )
    frame.write_csv(path)
    return path


def normal_error_mm(surface, T_true, T_found, n=60):
    """Largest normal displacement over the surface between two placements (4, 4) of the part."""
    gu, gv = np.meshgrid(np.linspace(*surface.u, n), np.linspace(*surface.v, n))
    p, nn = surface.point(gu.ravel(), gv.ravel()), surface.normal(gu.ravel(), gv.ravel())
    a = p @ T_true[:3, :3].T + T_true[:3, 3]
    b = p @ T_found[:3, :3].T + T_found[:3, 3]
    return float(np.abs(((b - a) * (nn @ T_true[:3, :3].T)).sum(1)).max())
