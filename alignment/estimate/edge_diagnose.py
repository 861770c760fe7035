"""What the crossings of edges say about a fit: edges that are not where CAD has them, and laws in another order.

On a flat part the order of the laws hardly shows in the distances. At the edges it does: a law crosses where its place in the
array says, and in the wrong order crossings at the ends of the array contradict those of the other passes.
"""

from typing import Any

import numpy as np

from alignment.cloud import PointCloud
from alignment.estimate.capture import capture
from alignment.estimate.edge_report import LEAST_CROSSINGS, few_agree, off_edges
from alignment.estimate.hypotheses import Hypothesis, thinned
from alignment.estimate.map import MapFit, align_map
from alignment.estimate.problem import Problem
from planner.issues import Issue
from planner.setup import Setup

# A crossing that belongs to no edge counts as this far off (mm).
UNMATCHED_MM = 0.5
# Crossings that lie farther off than this, all in all (rms, mm), or ends of passes (rms of their medians), are worth a look for
# what would explain them.
SUSPICIOUS_MM, SUSPICIOUS_END_MM = 0.1, 0.03
# Another order of laws has to leave less than this share of either; of ends of passes only if single crossings like it, too.
BETTER, LIKED = 0.5, 0.9
# An order with which the distances scatter so many times more is none.
SCATTERS_MORE = 1.3
SAMPLE = 4_000
# Edges seen this much late or early (mm), and by so many standard deviations, are worth a word.
LATE_MM, LATE_SIGMAS = 0.15, 4.0


def edge_issues(found: MapFit, setup: Setup) -> list[Issue]:
    """Return warnings where the placement does not fit the edges that were crossed, and where they are seen late."""
    if found.edges is None:
        return []
    return _off(found.edges) + _late(found.edges, setup)


def _late(edges: dict[str, Any], setup: Setup) -> list[Issue]:
    late_mm = edges["late_mm"]
    if abs(late_mm) < max(LATE_MM, LATE_SIGMAS * edges["late_sigma_mm"]):
        return []
    word, speed = "late" if late_mm > 0 else "early", setup.alignment.scan_speed_mm_s
    text = (
        f"edges are seen {abs(late_mm):.2f} mm {word} along the travel: echoes are recorded {word} against the poses (by "
        f"{1e3 * abs(late_mm) / speed:.1f} ms at {speed:g} mm/s), or the beam is cut off otherwise than at half. It was "
        "estimated along; without passes in opposite directions the part would seem to have moved."
    )
    remedy = (
        "Correct the delay between ultrasound and robot: the inspection's forward and backward passes shift by it, too."
    )
    return [Issue("warning", "edges-late", text, remedy, "scan")]


def _off(edges: dict[str, Any]) -> list[Issue]:
    if not off_edges(edges):
        return []
    if few_agree(edges):
        what = f"only {edges['used']} of {edges['crossings']} crossings lie on the CAD's edges at this placement"
    else:
        what = f"at this placement the ends of passes lie {edges['off_mm']:.2f} mm rms off the CAD's edges"
    why = "the part has sprung back or is trimmed otherwise, something lies on it, or the laws of the scan are not as said"
    remedy = (
        "Look where they lie off; if the part has sprung back, run the alignment as non-rigid: it stays on the edges."
    )
    return [Issue("warning", "off-edges", f"{what}: {why}; along the surface it may be elsewhere.", remedy, "scan")]


def order_by_edges(
    cloud: PointCloud, problem: Problem, found: MapFit, hypotheses: list[Hypothesis]
) -> Hypothesis | None:
    """Return the order of laws with which the crossings lie on their edges, where with the given one they do not."""
    off_mm, end_mm = _off_edges_mm(found), _off_ends_mm(found)
    if off_mm <= SUSPICIOUS_MM and end_mm <= SUSPICIOUS_END_MM:
        return None
    small = thinned(cloud, SAMPLE)
    most_mm = SCATTERS_MORE * capture(small, problem).scatter_mm
    least, chosen = off_mm, None
    for hypothesis in hypotheses:
        if not hypothesis.of_laws or capture(hypothesis.apply(small), problem).scatter_mm > most_mm:
            continue
        other = align_map(hypothesis.apply(cloud), problem.curved, problem.setup)
        if not (isinstance(other, MapFit) and other.converged and _enough(other)):
            continue
        other_mm = _off_edges_mm(other)
        ends_agree = _off_ends_mm(other) < BETTER * end_mm and other_mm < LIKED * off_mm
        if other_mm < least and (other_mm < BETTER * off_mm or ends_agree):
            least, chosen = other_mm, hypothesis
    return chosen


def _off_ends_mm(found: MapFit) -> float:
    """Return how far the ends of passes lie off their edges (rms of their medians, mm); 0 without crossings."""
    return 0.0 if found.edges is None else float(found.edges["off_mm"])


def _enough(found: MapFit) -> bool:
    return found.edges is not None and found.edges["used"] >= LEAST_CROSSINGS


def _off_edges_mm(found: MapFit) -> float:
    """Return how far all crossings lie off their edges (rms, mm), those without an edge included; 0 without crossings."""
    if found.edges is None or found.edges["crossings"] == 0:
        return 0.0
    share = found.edges["used"] / found.edges["crossings"]
    squares = share * min(found.edges["rms_mm"], UNMATCHED_MM) ** 2 + (1.0 - share) * UNMATCHED_MM**2
    return float(np.sqrt(squares))
