"""Passes as statements: approach, lead-in, scan with its data switch, lead-out, retract, links."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kuka_export.numbers import real_text
from kuka_export.options import ProgramOptions
from kuka_export.profiles import Family, Profile
from kuka_export.program import Comment, Moves, Setting, SplineBlock, Statement, Trigger, WaitInput
from kuka_export.route import Route, data_switches, shifted, spacing_mm
from planner.frames import Array
from planner.setup import Setup
from planner.toolpath import Role

# Straight lines may be cut between modules after this many; spline passes are cut at the ends of their blocks.
LIN_CHUNK = 500
# Lines of a module that are not poses of one chunk: header, DEF, END, fold, speeds, triggers.
ROOM_BESIDE = 30


@dataclass(frozen=True)
class Style:
    """Everything a pass needs besides its poses."""

    family: Family
    segments: int
    chunk: int
    blend: str
    data_output: int | None
    pulse_s: float
    wait_input: int | None


@dataclass(frozen=True, eq=False)
class Chunk:
    """Statements that may not be torn apart, of rows [start, stop) of the route."""

    pass_id: int
    start: int
    stop: int
    body: tuple[Statement, ...]


def blend_distance_mm(r: Route, family: Family, options: ProgramOptions) -> float:
    """Return $APO.CDIS (mm): as asked, but at most half the closest spacing at a blended pose. 0: no blending."""
    blended = r.role == Role.LINK
    if not family.block:
        blended |= r.scan & ~r.arrival
    if not blended.any():
        return 0.0
    step = spacing_mm(r.poses)
    both = np.minimum(step, np.append(step[1:], np.inf))[blended]
    limit = 0.5 * float(both[both > 0.0].min(initial=math.inf))
    value = math.floor(min(options.blend_mm, limit) * 1000.0 + 1e-6) / 1000.0
    return value if value >= 0.01 else 0.0


def style_of(setup: Setup, profile: Profile, options: ProgramOptions, blend_mm: float) -> Style:
    """Return the style of the passes of one program."""
    family = profile.families[options.motion or profile.default_motion]
    output = None if options.signal == "none" else setup.signals.data_output
    room = (options.module_lines or profile.module_lines) - ROOM_BESIDE
    return Style(
        family=family,
        segments=min(options.segments or profile.segments, room),
        chunk=min(LIN_CHUNK, room),
        blend=family.blend if blend_mm > 0.0 else "",
        data_output=output,
        pulse_s=options.pulse_s if options.signal == "pulse" else 0.0,
        wait_input=setup.signals.wait_input,
    )


def pass_chunks(r: Route, style: Style) -> list[Chunk]:
    """Return the statements of all passes in order, in pieces that may stand in different modules."""
    on, off = data_switches(r)
    starts = np.flatnonzero(r.arrival | (r.scan != shifted(r.scan, False)) | (shifted(r.pass_id, -1) != r.pass_id))
    starts = np.unique(np.concatenate([[0], starts])) if len(r) else starts
    chunks: list[Chunk] = []
    for a, b in zip(starts.tolist(), [*starts[1:].tolist(), len(r)], strict=True):
        if r.scan[a]:
            made = _scan(r, style, on, off, a, b)
        else:
            made = [(i, j, _points(r, style, i, j)) for i, j in _bounds(a, b, style.chunk)]
        chunks += [Chunk(int(r.pass_id[a]), i, j, tuple(body)) for i, j, body in made]
    return chunks


def block_numbers(r: Route, style: Style) -> NDArray[np.int32]:
    """Return the number of the spline block of every pose, -1 outside (n,)."""
    block = np.full(len(r), -1, dtype=np.int32)
    if not style.family.block:
        return block
    arrivals = np.flatnonzero(r.arrival)
    number = 0
    for a in arrivals.tolist():
        stop = _scan_end(r, a)
        for i, j in _bounds(a + 1, stop, style.segments):
            block[i:j] = number
            number += 1
    return block


def _scan_end(r: Route, a: int) -> int:
    out = np.flatnonzero(~r.scan[a + 1 :] | r.arrival[a + 1 :])
    return a + 1 + int(out[0]) if len(out) else len(r)


def _bounds(start: int, stop: int, most: int) -> list[tuple[int, int]]:
    """Cut [start, stop) into equal parts of at most `most`: no stub of one segment at the end of a long pass."""
    n = stop - start
    parts = math.ceil(n / most)
    edges = [start + round(n * k / parts) for k in range(parts + 1)] if parts else []
    return list(itertools.pairwise(edges))


def _points(r: Route, style: Style, a: int, b: int) -> list[Statement]:
    """Approach, retract and links: straight motions, each at its own speed; only links are blended."""
    body: list[Statement] = []
    link = r.role[a:b] == Role.LINK
    change = np.flatnonzero((link[1:] != link[:-1]) | (np.diff(r.speed_mm_s[a:b]) != 0.0)) + a + 1
    speed = math.nan
    for i, j in zip([a, *change.tolist()], [*change.tolist(), b], strict=True):
        if r.speed_mm_s[i] != speed:
            speed = float(r.speed_mm_s[i])
            body.append(_speed(speed))
        body.append(Moves(style.family.point, r.poses[i:j], style.blend if r.role[i] == Role.LINK else ""))
    return body


def _scan(r: Route, style: Style, on: NDArray, off: NDArray, a: int, b: int) -> list[tuple[int, int, list[Statement]]]:
    """One run of scan poses [a, b): the first by a straight motion to a stop, the rest as blocks or blended lines.

    A long pass becomes several blocks that meet in one pose. The robot stops there for a moment; the data signal stays
    on, so that nothing is missed, and no segment is driven twice.
    """
    family = style.family
    head: list[Statement] = [] if style.wait_input is None else [WaitInput(style.wait_input)]
    head.append(_speed(float(r.speed_mm_s[a])))
    head += _switched(r.poses, style, on, off, a, a + 1, family.point, "")
    speed = float(r.speed_mm_s[min(a + 1, b - 1)])
    if family.block:
        parts: list[tuple[int, int, list[Statement]]] = []
        for i, j in _bounds(a + 1, b, style.segments):
            inner = _switched(r.poses, style, on, off, i, j, family.dense, "")
            parts.append((i, j, [SplineBlock(speed / 1000.0, tuple(inner))]))
    else:
        parts = []
        for i, j in _bounds(a + 1, b, style.chunk):
            last = j == b
            same = i == a + 1 and speed == float(r.speed_mm_s[a])
            body: list[Statement] = [] if same else [_speed(speed)]
            body += _switched(r.poses, style, on, off, i, j - last, family.dense, style.blend)
            if last:
                body += _switched(r.poses, style, on, off, j - 1, j, family.dense, "")
            parts.append((i, j, body))
    if not parts:
        return [(a, b, head)]
    _, j, body = parts[0]
    return [(a, j, head + body), *parts[1:]]


def _switched(
    poses: Array, style: Style, on: NDArray, off: NDArray, i: int, j: int, word: str, blend: str
) -> list[Statement]:
    """Return motions to rows [i, j), with the data switch standing before the motion at whose end it acts."""
    if j <= i:
        return []
    cuts = set((np.flatnonzero(on[i:j] | off[i:j]) + i).tolist())
    body: list[Statement] = []
    edges = sorted({i, *cuts})
    for k, m in zip(edges, [*edges[1:], j], strict=True):
        if k in cuts:
            body.append(_switch(style, bool(on[k])))
        body.append(Moves(word, poses[k:m], blend))
    return body


def _switch(style: Style, value: bool) -> Statement:
    if style.data_output is None:
        return Comment("DATA ON AT THE NEXT POSE" if value else "DATA OFF AT THE NEXT POSE")
    return Trigger(style.family.trigger, "end", style.data_output, value, style.pulse_s)


def _speed(mm_s: float) -> Setting:
    return Setting("$VEL.CP", real_text(mm_s / 1000.0))
