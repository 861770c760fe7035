"""Passes into modules, modules into loads, against the controller's limits."""

from collections.abc import Iterable
from dataclasses import dataclass

from kuka_export.passes import Chunk
from kuka_export.profiles import Profile
from kuka_export.program import Fold, Module, Moves, SplineBlock, Statement
from kuka_export.writer import source_bytes

# Header, DEF and END of a module; a main module with its comments and calls.
MODULE_OVERHEAD_LINES = 8
MAIN_BYTES = 8_000


@dataclass(frozen=True, eq=False)
class Packed:
    """A motion module with its rows [start, stop) of the route; `starts_pass` is False if it goes on inside a pass."""

    module: Module
    start: int
    stop: int
    starts_pass: bool
    lines: int
    bytes: int


def line_count(body: Iterable[Statement]) -> int:
    """Return how many lines statements take."""
    total = 0
    for s in body:
        if isinstance(s, Moves):
            total += len(s.poses)
        elif isinstance(s, Fold | SplineBlock):
            total += 2 + line_count(s.body)
        else:
            total += 1
    return total


@dataclass(frozen=True, eq=False)
class _Piece:
    fold: Fold
    start: int
    stop: int
    starts_pass: bool
    alone: bool


def pack_modules(chunks: list[Chunk], stem: str, profile: Profile, module_lines: int) -> list[Packed]:
    """Return motion modules `<stem>_001`...: whole passes, as many as fit; a longer pass is cut between its blocks."""
    room = module_lines - MODULE_OVERHEAD_LINES
    modules: list[list[_Piece]] = []
    used = 0
    for piece in (p for group in _by_pass(chunks) for p in _pieces(group, room)):
        lines = line_count([piece.fold])
        if not modules or piece.alone or modules[-1][-1].alone or used + lines > room:
            modules.append([])
            used = 0
        modules[-1].append(piece)
        used += lines
    return [_packed(f"{stem}_{k:03d}", pieces, profile) for k, pieces in enumerate(modules, 1)]


def pack_loads(packed: list[Packed], load_bytes: int, load_modules: int) -> list[list[Packed]]:
    """Return modules grouped into loads; a pass that goes on in the next module stays with it.

    Raises ValueError with a sentence if one pass alone is larger than a load.
    """
    room_bytes, room_modules = load_bytes - MAIN_BYTES, load_modules - 2
    groups: list[list[Packed]] = []
    for item in packed:
        if item.starts_pass or not groups:
            groups.append([])
        groups[-1].append(item)
    loads: list[list[Packed]] = []
    for group in groups:
        size = sum(p.bytes for p in group)
        if size > room_bytes or len(group) > room_modules:
            raise ValueError(
                f"one pass takes {size} bytes in {len(group)} modules; a load holds {room_bytes} bytes"
                f" in {room_modules} modules"
            )
        full = not loads or (
            sum(p.bytes for p in loads[-1]) + size > room_bytes or len(loads[-1]) + len(group) > room_modules
        )
        if full:
            loads.append([])
        loads[-1] += group
    return loads


def _by_pass(chunks: list[Chunk]) -> list[list[Chunk]]:
    groups: list[list[Chunk]] = []
    for chunk in chunks:
        if not groups or groups[-1][-1].pass_id != chunk.pass_id:
            groups.append([])
        groups[-1].append(chunk)
    return groups


def _pieces(group: list[Chunk], room: int) -> list[_Piece]:
    title = f"PASS {group[0].pass_id + 1}"
    parts: list[list[Chunk]] = [[]]
    used = 2
    for chunk in group:
        lines = line_count(chunk.body)
        if parts[-1] and used + lines > room:
            parts.append([])
            used = 2
        parts[-1].append(chunk)
        used += lines
    alone = len(parts) > 1
    return [
        _Piece(
            Fold(f"{title} PART {k + 1}" if alone else title, tuple(s for c in part for s in c.body)),
            part[0].start,
            part[-1].stop,
            k == 0,
            alone,
        )
        for k, part in enumerate(parts)
    ]


def _packed(name: str, pieces: list[_Piece], profile: Profile) -> Packed:
    module = Module(name, tuple(p.fold for p in pieces))
    text = source_bytes(module, profile)
    return Packed(module, pieces[0].start, pieces[-1].stop, pieces[0].starts_pass, text.count(b"\n"), len(text))
