"""The record of an inspection: what EchoBase knows itself, computed, beside the places that people fill in."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from alignment.scan import Scan, SurfacePoints
from app.plan import Plan
from app.report.document import Line, Lines
from app.report.shown import MINUS, number, shown
from planner.couplant import sound_speed_m_s, water_speed_m_s

FULL_SCREEN_PCT = 100.0


@dataclass(frozen=True)
class ScanFacts:
    """What is said of one scan. strong: share of the echoes at full screen height or above; seconds: its duration."""

    role: str
    name: str
    sha256: str
    simulated: bool
    readings: int
    poses: int
    lost: int
    strong: float | None
    seconds: float | None

    @classmethod
    def of(cls, scan: Scan | SurfacePoints, role: str = "") -> "ScanFacts":
        """Return the facts of a scan."""
        n = len(scan)
        level = scan.amplitude_pct
        level = None if level is None else level[np.isfinite(level)]
        strong = None if level is None or not len(level) else float(np.mean(level >= FULL_SCREEN_PCT))
        if isinstance(scan, SurfacePoints):
            return cls(role, scan.name, scan.sha256, scan.simulated, n, n, 0, strong, None)
        lost = int(np.count_nonzero(~np.isfinite(scan.tof_us)))
        seconds = None if scan.t_s is None or not n else float(scan.t_s[-1] - scan.t_s[0])
        return cls(role, scan.name, scan.sha256, scan.simulated, n, len(scan.Ts_scan_tcp), lost, strong, seconds)


def record_lines(plan: Plan, scans: Sequence[ScanFacts]) -> tuple[Lines, ...]:
    """Return the groups of the record: part, procedure, equipment, set-up, couplant, calibration, scan, people."""
    setup, part = plan.setup, plan.part.provenance
    probe, tolerances = setup.probe, setup.tolerances
    array = f"{probe.elements} elements, pitch {probe.pitch_mm:g} mm" if probe.elements > 1 else "single crystal"
    aperture = f"{probe.aperture_elements} elements, {probe.laws} laws" if probe.elements > 1 else "one law"
    size = " x ".join(f"{v:.1f}" for v in plan.part.extents_mm)
    groups = {
        "Part": [
            _ask("Part number", "part.number"),
            _ask("Serial number", "part.serial"),
            _ask("Drawing, issue", "part.drawing"),
            _say("CAD", f"{part.name}, {size} mm"),
            _ask("Material", "part.material"),
            _ask("Thickness", "part.thickness"),
            _ask("Curing lot", "part.curing_lot"),
        ],
        "Procedure": [
            _ask("Procedure, revision", "procedure.document"),
            _ask("Standard", "procedure.standard"),
            _ask("Acceptance criteria", "procedure.acceptance"),
            _say(
                "Tolerances",
                f"tilt {tolerances.tilt_deg:g} deg, standoff {tolerances.standoff_mm:g} mm, {tolerances.loss_db:g} dB",
            ),
        ],
        "Equipment": [
            _ask("Ultrasonic set", "equipment.instrument"),
            _ask("Its serial number", "equipment.instrument_serial"),
            _ask("Its calibration due", "equipment.instrument_due"),
            _ask("Probe", "equipment.probe"),
            _ask("Its serial number", "equipment.probe_serial"),
            _say("Probe as planned", f"{array}, {probe.frequency_mhz:g} MHz"),
            _ask("Nozzle", "equipment.nozzle"),
            _ask("Cable", "equipment.cable"),
            _say("Robot, controller", f"{setup.robot}, {setup.controller}"),
            _ask("Robot serial number", "equipment.robot_serial"),
            _ask("Controller software", "equipment.controller_version"),
        ],
        "Settings": [
            _say("Aperture", aperture),
            _say("Reference amplitude", f"{setup.reference_amplitude_pct:g} %FSH"),
            _ask("Law file", "settings.law_file"),
            _ask("Focus", "settings.focus"),
            _ask("Gain", "settings.gain_db", "dB"),
            _ask("PRF", "settings.prf_hz", "Hz"),
            _ask("Filter", "settings.filter"),
            _ask("Averaging", "settings.averaging"),
            _ask("TCG", "settings.tcg"),
            _ask("Gates", "settings.gates"),
            _ask("Sampling", "settings.sampling_mhz", "MHz"),
        ],
        "Couplant": _couplant(plan),
        "Calibration": [
            _ask("Reference block", "calibration.block"),
            _ask("Its calibration due", "calibration.block_due"),
            _ask("Transfer correction", "calibration.transfer_db", "dB"),
            _ask("Sensitivity check before", "calibration.sensitivity_before_db", "dB"),
            _ask("Sensitivity check after", "calibration.sensitivity_after_db", "dB"),
            _ask("TCP calibration", "calibration.tcp"),
            _ask("Its residual", "calibration.tcp_residual_mm", "mm"),
            _ask("Nominal BASE found by", "calibration.base"),
            _ask("Latency of the poses", "calibration.latency_ms", "ms"),
        ],
        "Scan": _scan(plan, scans),
        "People": [
            _ask("Operator", "people.operator"),
            _ask("Qualification", "people.operator_level"),
            _ask("Reviewer", "people.reviewer"),
            _ask("Qualification", "people.reviewer_level"),
            _ask("Begun", "people.begun"),
            _ask("Ended", "people.ended"),
            _ask("Remarks", "people.remarks"),
        ],
    }
    return tuple(Lines(title=title, lines=tuple(lines)) for title, lines in groups.items())


def temperature_mm_per_c(plan: Plan, standoff_mm: float) -> float:
    """Return how far the surface seems to move per deg C of wrong water temperature at a standoff (mm)."""
    t = plan.setup.couplant.temperature_c
    low, high = max(t - 0.5, 0.0), min(t + 0.5, 95.0)
    slope = (water_speed_m_s(high) - water_speed_m_s(low)) / ((high - low) * water_speed_m_s(t))
    return standoff_mm * slope


def temperatures(plan: Plan, standoff_mm: float) -> dict[str, float]:
    """Return what notes on the water temperature at a standoff are computed from; nothing if the speed of sound is set."""
    couplant = plan.setup.couplant
    if couplant.sound_speed_m_s is not None:
        return {}
    slope = temperature_mm_per_c(plan, standoff_mm)
    return {"temperature_c": couplant.temperature_c, "mm_per_c": slope, "standoff_mm": standoff_mm}


def _couplant(plan: Plan) -> list[Line]:
    couplant = plan.setup.couplant
    speed = sound_speed_m_s(couplant)
    source = (
        "as set" if couplant.sound_speed_m_s is not None else f"water at {couplant.temperature_c:g} deg C, Marczak 1997"
    )
    return [
        _say("Speed of sound used", f"{speed:.2f} m/s ({source})"),
        _say("Delay", f"{couplant.delay_us:g} us".replace("-", MINUS)),
        _ask("Additives", "couplant.additives"),
        _ask("Temperature at the start", "couplant.temperature_start_c", "deg C"),
        _ask("Temperature at the end", "couplant.temperature_end_c", "deg C"),
        _ask("Flow", "couplant.flow"),
    ]


def _scan(plan: Plan, scans: Sequence[ScanFacts]) -> list[Line]:
    setup = plan.setup
    total, lost = sum(s.readings for s in scans), sum(s.lost for s in scans)
    out = [
        _say("Standoff", f"{setup.standoff_mm:g} mm; alignment scan {setup.alignment_standoff_mm:g} mm"),
        _say(
            "Speed, mm/s", f"{setup.inspection.scan_speed_mm_s:g}; alignment scan {setup.alignment.scan_speed_mm_s:g}"
        ),
        _say("Index, overlap", _index(plan)),
        _say("Direction", f"{setup.inspection.strategy}, {setup.inspection.direction_deg:g} deg"),
    ]
    for kind in ("alignment", "inspection"):
        covered = (plan.summary.get(kind) or {}).get("coverage") or {}
        if "share" in covered:
            out.append(
                _say(f"Coverage, {kind}", f"{100.0 * covered['share']:.1f} % of {plan.surface.area_mm2 / 100:.1f} cm2")
            )
    if total:
        out.append(_say("Readings", f"{total}, without an echo {shown(number(100.0 * lost / total, 2, unit='%'))}"))
    strong = [(s.strong, s.readings) for s in scans if s.strong is not None]
    if strong:
        share = float(np.average([v for v, _ in strong], weights=[n for _, n in strong]))
        out.append(_say("At or above 100 %FSH", shown(number(100.0 * share, 2, unit="%"))))
    times = [s.seconds for s in scans if s.seconds is not None]
    if times:
        out.append(_say("Duration", f"{sum(times):.1f} s"))
    return out


def _index(plan: Plan) -> str:
    """Return the distance of neighbouring passes, measured on the planned path, and what they overlap of the swath."""
    data = plan.inspection.take(plan.inspection.is_data)
    xyz, swath = data.Ts_part_contact.xyz_mm, plan.setup.probe.swath_mm
    passes = np.unique(data.pass_id)
    gaps = []
    for k in (
        np.unique(np.linspace(0, len(passes) - 2, min(len(passes) - 1, 40)).astype(np.intp)) if len(passes) > 1 else []
    ):
        here, there = xyz[data.pass_id == passes[k]], xyz[data.pass_id == passes[k + 1]]
        gaps.append(float(np.median(cKDTree(there).query(here)[0])))
    if not gaps:
        return f"one pass, swath {swath:.1f} mm"
    step = float(np.median(gaps))
    return f"{step:.2f} mm as planned, overlap {100.0 * (1.0 - step / swath):.0f} % of a swath of {swath:.1f} mm"


def _say(label: str, value: str) -> Line:
    return Line(label=label, value=value)


def _ask(label: str, field: str, unit: str = "") -> Line:
    return Line(label=label, field=field, unit=unit)
