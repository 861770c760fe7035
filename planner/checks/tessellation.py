"""Whether the triangles are fine enough for the surface they describe."""

from planner.issues import Issue
from planner.setup import Setup
from planner.surface.curved import CurvedSurface
from planner.surface.doubt import doubt_of

# Said from here on.
WORTH_DEG, WORTH_MM = 0.1, 0.01


def tessellation_issues(curved: CurvedSurface, setup: Setup) -> list[Issue]:
    """Return what a coarse tessellation leaves open: a warning where it is more than the tolerances, else a note."""
    doubt, tolerances = doubt_of(curved), setup.tolerances
    if doubt.deg <= WORTH_DEG and doubt.mm <= WORTH_MM:
        return []
    text = (
        f"The triangles are long for how the surface bends: normals between their corners are known to about"
        f" {doubt.deg:.2g} deg, places to about {doubt.mm:.2g} mm"
    )
    beyond = (doubt.face_deg > tolerances.tilt_deg) | (doubt.face_mm > tolerances.standoff_mm)
    area = float(curved.surface.face_areas_mm2[beyond].sum())
    if doubt.deg <= tolerances.tilt_deg and doubt.mm <= tolerances.standoff_mm:
        return [
            Issue(
                "info",
                "tessellation-coarse",
                f"{text}.",
                "Export the CAD with a finer tessellation if this matters.",
                "part",
            )
        ]
    return [
        Issue(
            "warning",
            "tessellation-normals",
            f"{text}; over {area:.0f} mm2 ({area / curved.surface.area_mm2:.1%} of the surface) that is more than"
            f" {tolerances.tilt_deg:g} deg or {tolerances.standoff_mm:g} mm, and poses there may miss the tolerances"
            " although all figures of this plan are within them.",
            "Export the CAD with a finer tessellation: a smaller chord error or angle, or STEP instead of a mesh.",
            "part",
        )
    ]
