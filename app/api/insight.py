"""What a set of key points is worth before the robot moves: verdicts, coverage, predicted accuracy."""

from app.view.model import Insight, KeyPointSet
from planner.errors import EchoBaseError
from planner.setup import Setup
from planner.surface.curved import CurvedSurface


def compute_insight(curved: CurvedSurface, given: KeyPointSet, setup: Setup) -> Insight:
    """Return the insight; what cannot be computed for these points is said as issues and left out."""
    # The planner is big and a server should answer at once: import what is asked for.
    from alignment.estimate.predict import predict  # noqa: PLC0415
    from planner.path.alignment import alignment_path  # noqa: PLC0415
    from planner.path.coverage import coverage  # noqa: PLC0415
    from planner.path.keypoints import snap, verdicts  # noqa: PLC0415

    if not given.points:
        return Insight(given.version)
    issues = []
    try:
        points = list(snap(curved, list(given.points)))
        issues = list(verdicts(curved, points, setup))
        path = alignment_path(curved, points, setup)
        covered = coverage(curved, path, setup)
        prediction = predict(path, curved, setup).to_json()
    except EchoBaseError as error:
        return Insight(given.version, (*issues, *error.issues))
    dof = prediction.get("dof", {})
    return Insight(
        given.version,
        tuple(issues),
        coverage=covered.share,
        path=path,
        covered=covered.face_share,
        normal_error_mm=prediction.get("normal_error_mm"),
        sigma={axis: float(value["sigma"]) for axis, value in dof.items()},
        status={axis: str(value["status"]) for axis, value in dof.items()},
    )
