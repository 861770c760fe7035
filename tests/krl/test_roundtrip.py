"""Random paths, random setups: text of the agreed form, and the same path back."""

# ruff: noqa: E501 (KRL text stays in one piece)

import re

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kuka_export.build import build_program
from kuka_export.language.library import load
from kuka_export.language.parse import parse_file
from kuka_export.options import ProgramOptions
from kuka_export.proof import prove
from kuka_export.reader import read_library, read_program
from kuka_export.writer import write_program
from planner.frames import Transform
from planner.toolpath import Role, ToolPath
from tests.krl.paths import correction, raster, setup

NUMBER = re.compile(r"-?\d+(\.\d+)?([eE][+-]?\d+)?")
STARTS = re.compile(
    r"(&|;|  |$|DEF |END$|EXT |DECL |DEFDAT |ENDDAT$|BASE_DATA\[|\$[A-Z]|S?PTP |S?LIN |SPL |SPLINE |ENDSPLINE$|TRIGGER |WAIT FOR |EB_)"
)


@st.composite
def paths(draw: st.DrawFn) -> ToolPath:
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    kind = draw(st.sampled_from(["alignment", "inspection", "corrected"]))
    roles: list[int] = []
    passes: list[int] = []
    for k in range(draw(st.integers(1, 4))):
        links, lead = draw(st.integers(0, 3)), draw(st.integers(0, 2))
        runs = [draw(st.integers(2, 30)) for _ in range(draw(st.integers(1, 3)))]
        body = [r for n in runs for r in [Role.DATA] * n + [Role.LEAD_OUT]][:-1]
        one = (
            [Role.LINK] * links
            + [Role.APPROACH]
            + [Role.LEAD_IN] * lead
            + body
            + [Role.LEAD_OUT] * lead
            + [Role.RETRACT]
        )
        roles += [int(r) for r in one]
        passes += [k] * len(one)
    n = len(roles)
    extreme = draw(st.sampled_from([1.0, 1e-3, 50.0]))
    points = np.cumsum(rng.normal(0.0, 10.0 * extreme, (n, 3)), axis=0)
    rotations = (
        Rotation.random(n, rng=rng)
        if draw(st.booleans())
        else Rotation.from_euler("ZYX", np.tile([10.0, 89.9999, -180.0], (n, 1)), degrees=True)
    )
    contact = Transform.from_parts("part", "contact", rotations, points)
    return ToolPath(kind, contact, rng.uniform(5, 80, n), rng.choice([-1, 1], n).astype(np.int8), np.array(passes, dtype=np.int32),
                    np.array(roles, dtype=np.uint8), np.zeros(n, dtype=np.int32), np.zeros((n, 3)))  # fmt: skip


@settings(max_examples=60)
@given(
    paths(), st.sampled_from(["krc2", "krc4", "krc5"]), st.sampled_from([None, "lin"]), st.sampled_from(["trigger", "pulse", "none"]),
    st.booleans(), st.integers(4, 12), st.sampled_from(["x", "-y", "z"]),
)  # fmt: skip
def test_random_programs(
    path: ToolPath, controller: str, motion: str, signal: str, corrected: bool, segments: int, beam: str
):
    s = setup(
        controller, taught=False, tool={"number": 1, "beam_axis": beam, "array_axis": "x" if beam != "x" else "z"}
    )
    options = ProgramOptions(motion=motion, signal=signal, segments=segments, module_lines=60)
    T = correction((0.5, -0.25, 0.125, 0.1, -0.2, 0.05)) if corrected else None
    program = build_program(
        path, s, "EB_RND", "r", T_base_basecorr=T, options=options, centroid_base_mm=[0.0, 0.0, 0.0]
    )
    files = write_program(program)
    for name, data in files.items():
        assert re.fullmatch(r"[A-Z][A-Z0-9_]{0,23}\.(src|dat)", name)
        assert data.isascii()
        assert data.endswith(b"\r\n")
        assert data.count(b"\r") == data.count(b"\n") == data.count(b"\r\n")
        text = data.decode("ascii")
        assert not re.search(r"-0\.0+(?![0-9])", text)
        assert not re.search(r"\d[eE][+-]?\d", text)
        assert not re.search(r"(?i)\b(nan|inf)\b", text)
        assert text.count("\r\n") <= 60 + 2 or name.endswith(".dat") or "_001" not in name
        assert all(STARTS.match(line) for line in text.split("\r\n"))
    proof = prove(program, files)
    assert proof.ok, proof.issues
    assert proof.poses == len(path)
    back = read_program(files).path
    data = path.role == Role.DATA
    np.testing.assert_array_equal(back.data_on[1:], (data[1:] & data[:-1]) & (path.pass_id[1:] == path.pass_id[:-1]))


def test_the_short_way_of_reading_gives_what_the_long_way_gives():
    files = write_program(build_program(raster(data=40, wave=7.0), setup(taught=False), "EB_RND"))
    fast, slow = load(files), load(files)
    for name, source in slow.files.items():
        slow.files[name] = parse_file(source.name, files[name].decode("ascii"), fast=False)
    slow.routines = {r.name: (s, r) for s in slow.files.values() for r in s.routines if r.word != "DEFDAT"}
    a, b = read_library(fast), read_library(slow)
    np.testing.assert_array_equal(a.poses, b.poses)
    assert a.words == b.words
    assert a.approximation == b.approximation
    np.testing.assert_array_equal(a.line, b.line)
