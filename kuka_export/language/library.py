"""The modules among given files: who defines what, who calls whom, which one a person would select."""

import gc
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from kuka_export.language.nodes import CallStatement, Control, Move, Routine, SourceFile, SplineOpen, Trigger
from kuka_export.language.parse import parse_file


@dataclass
class Library:
    """Parsed files. `routines`: upper-case name -> (file, routine) of what other files can call."""

    files: dict[str, SourceFile] = field(default_factory=dict)
    routines: dict[str, tuple[SourceFile, Routine]] = field(default_factory=dict)

    def find(self, name: str, source: SourceFile) -> tuple[SourceFile, Routine] | None:
        """Return the routine a call in `source` reaches: local ones first."""
        for routine in source.routines:
            if routine.name == name and routine.word != "DEFDAT":
                return source, routine
        return self.routines.get(name)

    def roots(self) -> list[tuple[SourceFile, Routine]]:
        """Return the modules nobody calls that move the robot, directly or by calls; by name, numbers in order."""
        called = {name for source in self.sources() for r in source.routines for name in calls(r)}
        tops = [(s, s.routines[0]) for s in self.sources() if s.routines]
        moving = [(s, r) for s, r in tops if r.name not in called and self.moves(s, r, frozenset())]
        return sorted(moving, key=lambda item: natural(item[1].name))

    def moves(self, source: SourceFile, routine: Routine, above: frozenset[str]) -> bool:
        """Return whether a routine moves the robot."""
        if any(isinstance(s, Move | SplineOpen) for s in routine.body):
            return True
        for name in calls(routine):
            found = None if name in above else self.find(name, source)
            if found is not None and self.moves(*found, above | {name}):
                return True
        return False

    def sources(self) -> list[SourceFile]:
        """Return the program files, not the data lists."""
        return [f for f in self.files.values() if not f.name.upper().endswith(".DAT")]


@contextmanager
def uncollected() -> Iterator[None]:
    """Pause the cycle collector: a program makes a million small objects without a cycle, and searching them takes longest."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def load(files: dict[str, bytes]) -> Library:
    """Return the library of file name -> bytes; text is read as Latin-1 so that nothing is lost before it is judged."""
    with uncollected():
        return _load(files)


def _load(files: dict[str, bytes]) -> Library:
    library = Library()
    for name, data in files.items():
        if not name.upper().endswith((".SRC", ".DAT", ".SUB")):
            continue
        source = parse_file(PurePosixPath(name.replace("\\", "/")).name, without_mark(data).decode("latin-1"))
        library.files[name] = source
        for k, routine in enumerate(source.routines):
            if routine.word != "DEFDAT" and (k == 0 or routine.is_global):
                library.routines.setdefault(routine.name, (source, routine))
    return library


def without_mark(data: bytes) -> bytes:
    """Return the bytes behind a UTF-8 byte order mark, so that it hides nothing else."""
    return data.removeprefix(b"\xef\xbb\xbf")


def calls(routine: Routine) -> list[str]:
    """Return the names a routine calls, triggers and interrupts included."""
    found: list[str] = []
    for s in routine.body:
        if isinstance(s, CallStatement):
            found.append(s.name)
        elif isinstance(s, Trigger) and isinstance(s.action, CallStatement):
            found.append(s.action.name)
        elif isinstance(s, Control) and s.word == "INTERRUPT DECL":
            found += s.names
    return found


def natural(name: str) -> list[tuple[int, int | str]]:
    """Return a sort key in which `_L2` stands before `_L10`."""
    return [(0, int(p)) if p.isdigit() else (1, p) for p in re.split(r"(\d+)", name) if p]
