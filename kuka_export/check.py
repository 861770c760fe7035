"""`echobase check`: what is wrong with KRL, ours or anybody's."""

from collections.abc import Iterator
from pathlib import PurePosixPath

from kuka_export.language.library import Library, calls, load
from kuka_export.language.nodes import Routine, SourceFile
from kuka_export.profiles import PROFILES, Profile
from kuka_export.rules.blocks import check_control, check_families, check_splines, check_triggers
from kuka_export.rules.finding import Finding, issue
from kuka_export.rules.motion import check_points, check_recursion, check_repeats, check_start
from kuka_export.rules.names import check_declarations, check_module, check_modules, check_undeclared, declared
from kuka_export.rules.text import check_bytes, check_folds, check_headers
from kuka_export.rules.values import check_values
from planner.issues import Issue

_GENERAL = PROFILES["krc4"]


def check_files(files: dict[str, bytes], controller: str | None = None, library: Library | None = None) -> list[Issue]:
    """Return the findings for file name -> bytes (.src, .dat, .sub), in order of file and line.

    `library`: the same files, parsed already. `controller`: krc2, krc4 or krc5 adds its limits and words; None: what any
    of them accepts. Errors are what no controller runs, or what would move the robot elsewhere than it says; the rest are
    warnings. A name that none of the files declares may be global on the controller: a warning.
    """
    library = load(files) if library is None else library
    if not library.files:
        return [Issue("error", "krl-no-files", "There is no .src or .dat file.", "Name the files of the program.", "")]
    profile = PROFILES.get(controller or "", _GENERAL)
    called = {name for s in library.sources() for r in s.routines for name in calls(r)}
    public = _public_names(library)
    found: list[Issue] = []
    for path, source in library.files.items():
        findings = [*check_bytes(files[path]), *_file(library, source, profile, controller, called, public)]
        found += [issue(source.name, f) for f in sorted(findings, key=lambda f: f.line)]
    found += [issue(name, f) for name, f in check_modules(library, files)]
    return list(dict.fromkeys(found))


def _file(
    library: Library, source: SourceFile, profile: Profile, controller: str | None, called: set[str], public: set[str]
) -> Iterator[Finding]:
    yield from (Finding(line, code, message) for line, code, message in source.problems)
    yield from check_headers(source)
    yield from check_folds(source)
    yield from check_module(source)
    if source.lines > profile.module_lines + 50 and not source.name.upper().endswith(".DAT"):
        yield Finding(
            1,
            "krl-module-size",
            f"The module has {source.lines} lines; {profile.module_lines} are known to be safe",
            "warning",
        )
    own = _own_data(library, source)
    for routine in source.routines:
        yield from check_declarations(source, routine, set() if routine.word == "DEFDAT" else own)
        yield from check_undeclared(library, source, routine, declared(routine) | own | public)
        yield from check_points(routine)
        yield from check_values(routine, profile.base_numbers, profile.tool_numbers)
        if routine.word != "DEFDAT":
            yield from _routine(library, source, routine, profile, controller, called)


def _routine(
    library: Library, source: SourceFile, routine: Routine, profile: Profile, controller: str | None, called: set[str]
) -> Iterator[Finding]:
    yield from check_control(routine)
    yield from check_splines(routine, profile.segments)
    yield from check_triggers(routine)
    yield from check_families(routine, controller)
    yield from check_repeats(routine)
    yield from check_start(library, source, routine, called)
    yield from check_recursion(library, source, routine)


def _own_data(library: Library, source: SourceFile) -> set[str]:
    """Return what the data list of the same name declares."""
    stem = PurePosixPath(source.name).stem.upper()
    names: set[str] = set()
    for other in library.files.values():
        if other.name.upper() == f"{stem}.DAT":
            for routine in other.routines:
                names |= declared(routine)
    return names


def _public_names(library: Library) -> set[str]:
    """Return what PUBLIC data lists declare, and enum and structure types wherever they stand."""
    names: set[str] = set()
    for source in library.files.values():
        for routine in source.routines:
            if routine.word == "DEFDAT" and (
                routine.is_public or source.name.upper() in ("$CONFIG.DAT", "$MACHINE.DAT")
            ):
                names |= declared(routine)
    return names
