"""Rules of names: modules, routines, declarations, what is used without one."""

import re
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath

from kuka_export.language.library import Library
from kuka_export.language.nodes import (
    Assign,
    CallExpression,
    CallStatement,
    Control,
    Declaration,
    Designator,
    External,
    Move,
    Note,
    Routine,
    SourceFile,
)  # fmt: skip
from kuka_export.language.vocabulary import KEYWORDS, PREDEFINED, TYPES
from kuka_export.rules.finding import Finding
from kuka_export.rules.walk import expressions_of, nested

MAX_NAME = 24
MANY_ROUTINES = 200
_MODULE = re.compile(r"[A-Z_$][A-Z0-9_$]*\Z")
_TYPE_WORDS = ("STRUC", "ENUM")


def check_module(source: SourceFile) -> Iterator[Finding]:
    """Yield faults of file and routine names."""
    stem = PurePosixPath(source.name).stem.upper()
    if len(stem) > MAX_NAME:
        yield Finding(1, "krl-name-length", f"The module name {stem} has {len(stem)} characters")
    elif not _MODULE.match(stem) or stem in KEYWORDS:
        yield Finding(1, "krl-module-name", f"{stem} is no name for a module")
    seen: set[str] = set()
    for k, routine in enumerate(source.routines):
        if k == 0 and routine.name not in (stem, "?"):
            yield Finding(
                routine.line, "krl-def-name", f"The file is {source.name}, its first routine is {routine.name}"
            )
        if routine.name in seen:
            yield Finding(routine.line, "krl-declared-twice", f"There are two routines {routine.name} in the file")
        seen.add(routine.name)
        if len(routine.name) > MAX_NAME and routine.name != stem:
            yield Finding(routine.line, "krl-name-length", f"{routine.name} has {len(routine.name)} characters")
    if len(source.routines) > MANY_ROUTINES:
        yield Finding(1, "krl-local-routines", f"The module has {len(source.routines)} routines", "warning")


def check_modules(library: Library, files: Mapping[str, bytes]) -> Iterator[tuple[str, Finding]]:
    """Yield modules that exist twice with different text: the controller has one name space over all folders."""
    seen: dict[str, str] = {}
    for path, source in library.files.items():
        key = source.name.upper()
        if key in seen and files[path] != files[seen[key]]:
            yield (
                source.name,
                Finding(1, "krl-module-twice", f"{path} and {seen[key]} are one module to the controller, and differ"),
            )
        seen.setdefault(key, path)


def check_declarations(source: SourceFile, routine: Routine, data_names: set[str]) -> Iterator[Finding]:
    """Yield late and double declarations, values where none belong, and names that are too long."""
    is_data = routine.word == "DEFDAT"
    started = 0
    seen: set[str] = set()
    for s in routine.body:
        if isinstance(s, Declaration):
            if started and not is_data:
                yield Finding(
                    s.line,
                    "krl-declaration-late",
                    f"{s.names[0].root} is declared after the first statement in line {started}",
                )
            if s.value is not None and not is_data and s.type != "SIGNAL":
                yield Finding(
                    s.line, "krl-init-in-src", f"{s.names[0].root} gets its value in the declaration", "warning"
                )
            if s.is_global and is_data and not routine.is_public:
                yield Finding(
                    s.line, "krl-global-dat", "GLOBAL has no effect in a data list that is not PUBLIC", "warning"
                )
            for name in s.names:
                if name.root in seen or (not is_data and name.root in data_names):
                    yield Finding(s.line, "krl-declared-twice", f"{name.root} is declared twice")
                seen.add(name.root)
                if len(name.root) > MAX_NAME:
                    yield Finding(s.line, "krl-name-length", f"{name.root} has {len(name.root)} characters")
        elif isinstance(s, Note | External) or (isinstance(s, Control) and s.word in _TYPE_WORDS):
            continue
        elif is_data and not isinstance(s, Assign):
            yield Finding(s.line, "krl-dat-statement", "A statement stands in a data list")
        elif not started:
            started = s.line
    if is_data:
        yield from _ascending(routine)


def _ascending(routine: Routine) -> Iterator[Finding]:
    last: dict[str, tuple[float, ...]] = {}
    for s in routine.body:
        d = (
            s.target
            if isinstance(s, Assign)
            else s.names[0]
            if isinstance(s, Declaration) and s.value is not None
            else None
        )
        if d is None or not d.index or len(d.names) > 1:
            continue
        index = tuple(getattr(i, "value", 0.0) for i in d.index)
        if d.root in last and index <= last[d.root]:
            yield Finding(s.line, "krl-ascending", f"{d.root}[{index[0]:g}] does not follow {last[d.root][0]:g}")
        last[d.root] = index


def declared(routine: Routine) -> set[str]:
    """Return the names a routine or data list declares: variables, parameters, EXT routines, types and enum values."""
    names = set(routine.parameters)
    for s in routine.body:
        if isinstance(s, Declaration):
            names |= {d.root for d in s.names}
        elif isinstance(s, External):
            names.add(s.name)
        elif isinstance(s, Control) and s.word in _TYPE_WORDS:
            names.add(s.names[0])
    if routine.word == "DEFFCT":
        names.add(routine.name)
    return names


def check_undeclared(library: Library, source: SourceFile, routine: Routine, known: set[str]) -> Iterator[Finding]:
    """Yield every name once that none of the given files declares: it may be global on the controller, so a warning."""
    told: set[str] = set()
    local = {r.name for r in source.routines}

    def unknown(name: str) -> bool:
        if name.startswith("$") or name in told or name in known or name in PREDEFINED or name in KEYWORDS:
            return False
        return name not in local and name not in library.routines

    for s in routine.body:
        if isinstance(s, Note) or (isinstance(s, Move) and s.pose is not None and not s.with_):
            continue
        if isinstance(s, Declaration) and s.type not in TYPES and s.type != "SIGNAL" and unknown(s.type):
            told.add(s.type)
            yield Finding(s.line, "krl-undeclared", f"The type {s.type} is declared in none of the files", "warning")
        names = [s.name] if isinstance(s, CallStatement) else []
        names += (
            [n for n in s.names if isinstance(s, Control) and s.word == "INTERRUPT DECL"]
            if isinstance(s, Control)
            else []
        )
        for e in expressions_of(s):
            names += [
                x.root if isinstance(x, Designator) else x.name
                for x in nested(e)
                if isinstance(x, Designator | CallExpression)
            ]
        for name in names:
            if unknown(name):
                told.add(name)
                yield Finding(s.line, "krl-undeclared", f"{name} is declared in none of the files", "warning")
