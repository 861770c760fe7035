"""From a tool path to a program: preflight, then statements. Any error: no program."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from kuka_export.main_module import BasePlan, Start, base_module, information, main_module
from kuka_export.modules import Packed, pack_loads, pack_modules
from kuka_export.names import duplicates
from kuka_export.options import DEFAULT_OPTIONS, ProgramOptions
from kuka_export.passes import blend_distance_mm, block_numbers, pass_chunks, style_of
from kuka_export.preflight import (
    check_correction,
    check_path,
    check_request,
    check_route,
    data_centroid_base_mm,
    loads_issue,
    size_issue,
)
from kuka_export.profiles import Profile, profile_of
from kuka_export.program import KrlProgram, Load, Module
from kuka_export.route import Route, data_switches, route, scan_speed_mm_s, shifted
from planner.errors import EchoBaseError
from planner.frames import Transform
from planner.issues import Issue, errors_in
from planner.placement import assume_nominal, corrected_base, define_corrected
from planner.robot import first_axes, load_robot
from planner.setup import Setup
from planner.toolpath import ToolPath


def build_program(
    path: ToolPath,
    setup: Setup,
    name: str,
    label: str = "",
    *,
    T_base_basecorr: Transform | None = None,
    options: ProgramOptions = DEFAULT_OPTIONS,
    notes: Sequence[str] = (),
    centroid_base_mm: ArrayLike | None = None,
) -> KrlProgram:
    """Return the program of a decimated path.

    `name`: stem of all module names, at most 16 characters of A-Z, 0-9, `_`. `T_base_basecorr`: the correction; motion
    modules are the same with and without it, so pass the inspection path itself and the same name. Poses that were
    adapted themselves need `options.adapted`, which names their modules apart. `centroid_base_mm` (3,): area centroid of
    the inspection surface in the nominal base, where the correction limits apply; None: the mean data contact point.

    Raises EchoBaseError with every error of the preflight: names, indices, speeds, poses, correction limits, sizes, and
    a first pose that the robot cannot reach.
    """
    profile = profile_of(setup.controller)
    corrected = T_base_basecorr is not None
    T_part = define_corrected(setup.T_base_partnom) if corrected else assume_nominal(setup.T_base_partnom)
    issues = check_request(path, setup, profile, name, options) + check_path(path)
    _stop_on_errors(issues)
    r = route(path, setup, options, T_part)
    issues += check_route(r, (options.motion or profile.default_motion) == "spline")
    _stop_on_errors(issues)
    centroid = data_centroid_base_mm(r, path, setup) if centroid_base_mm is None else centroid_base_mm
    issues += check_correction(setup, T_base_basecorr, centroid, r)
    _stop_on_errors(issues)

    stem = f"{name}_A" if options.adapted else name
    main = f"{stem}_C" if corrected and not options.adapted else stem
    base = _base_plan(setup, T_base_basecorr)
    blend_mm = blend_distance_mm(r, profile.families[options.motion or profile.default_motion], options)
    style = style_of(setup, profile, options, blend_mm)
    packed = pack_modules(pass_chunks(r, style), stem, profile, options.module_lines or profile.module_lines)
    load_bytes, load_modules = options.load_bytes or profile.load_bytes, options.load_modules or profile.load_modules
    try:
        groups = pack_loads(packed, load_bytes, load_modules)
    except ValueError as error:
        raise EchoBaseError(*issues, size_issue(str(error), f"setup.json: controller {profile.name}")) from error
    if len(groups) > 1:
        issues.append(
            loads_issue([len(g) for g in groups], sum(p.bytes for p in packed), profile, load_bytes, load_modules)
        )

    base_name = None if base.frame is None else f"{main}_BASE"
    modules: list[Module] = []
    loads: list[Load] = []
    starts: list[Start | None] = []
    for k, group in enumerate(groups, 1):
        a, b = group[0].start, group[-1].stop
        start = None if base.frame is None else _start(setup, r, a, b, T_base_basecorr, issues)
        load_main = main if len(groups) == 1 else f"{main}_L{k}"
        modules.append(
            _main(
                load_main,
                group,
                base_name,
                base,
                setup,
                profile,
                options,
                r,
                (a, b),
                label,
                notes,
                blend_mm,
                style.data_output,
                start,
                f"LOAD {k} OF {len(groups)}" if len(groups) > 1 else "",
            )
        )
        loads.append(Load(load_main, (*([base_name] if base_name else []), *(p.module.name for p in group))))
        starts.append(start)
    if base_name is not None:
        modules.append(base_module(base_name, base, setup.base.number))
    modules += [p.module for p in packed]
    twice = duplicates(m.name for m in modules)
    if twice:
        issues.append(
            Issue("error", "krl-name", f"Two modules would be named {twice[0]}.", "Choose another name.", "name")
        )
    _stop_on_errors(issues)
    on, off = data_switches(r)
    return KrlProgram(
        name=main,
        stem=stem,
        kind=path.kind,
        profile=profile.name,
        label=label,
        modules=tuple(modules),
        loads=tuple(loads),
        poses=r.poses,
        data_on=shifted(np.cumsum(on) - np.cumsum(off), 0) > 0,
        pass_id=r.pass_id,
        block=block_numbers(r, style),
        speed_mm_s=r.speed_mm_s,
        first_axes_deg=tuple(None if s is None else s.axes_deg for s in starts),
        base_number=base.number,
        tool_number=setup.tool.number,
        base_frame=base.frame,
        base_offset=base.offset,
        data_output=style.data_output,
        signal=options.signal if style.data_output is not None else "none",
        wait_input=style.wait_input,
        limits={
            "load_bytes": load_bytes,
            "load_modules": load_modules,
            "module_lines": options.module_lines or profile.module_lines,
            "segments": style.segments,
        },
        issues=tuple(issues),
    )


def _base_plan(setup: Setup, T_base_basecorr: Transform | None) -> BasePlan:
    nominal = np.array(setup.base.xyzabc(), dtype=np.float64)
    if T_base_basecorr is None:
        return BasePlan(setup.base.number, nominal if setup.base.is_taught else None, None, nominal, None)
    found = T_base_basecorr.xyzabc
    if not setup.base.is_taught:
        # The controller's own base is unknown here: composing on it stays right however often the program runs.
        return BasePlan(setup.base.number, None, found, nominal, found)
    frame = corrected_base(setup.T_world_base, T_base_basecorr).xyzabc
    number = setup.base.number if setup.base.corrected_number is None else setup.base.corrected_number
    return BasePlan(number, frame, None, nominal, found)


def _start(
    setup: Setup, r: Route, a: int, b: int, T_base_basecorr: Transform | None, issues: list[Issue]
) -> Start | None:
    """Return the axis values of the first pose of rows [a, b), in the configuration that serves them all."""
    T_world = setup.T_world_base if T_base_basecorr is None else corrected_base(setup.T_world_base, T_base_basecorr)
    try:
        found = first_axes(load_robot(setup.robot), setup, r.Ts_tcp[a:b], T_world)
    except EchoBaseError as error:
        issues += error.issues
        return None
    return Start(found.axes_deg, found.status, found.turn)


def _main(
    name: str,
    group: list[Packed],
    base_name: str | None,
    base: BasePlan,
    setup: Setup,
    profile: Profile,
    options: ProgramOptions,
    r: Route,
    rows: tuple[int, int],
    label: str,
    notes: Sequence[str],
    blend_mm: float,
    data_output: int | None,
    start: Start | None,
    load: str,
) -> Module:
    a, b = rows
    title = f"corrected {r.kind}" if base.correction is not None and r.kind != "corrected" else r.kind
    passes = len(np.unique(r.pass_id[a:b]))
    text = information(title, label, base, setup, r.poses[a:b], passes, options, tuple(notes), load)
    speed = scan_speed_mm_s(r.kind, setup, options)
    calls = [p.module.name for p in group]
    return main_module(name, calls, base_name, base, setup, profile, options, text, speed, blend_mm, data_output, start)


def _stop_on_errors(issues: list[Issue]) -> None:
    errors = errors_in(issues)
    if errors:
        raise EchoBaseError(*errors)
