"""The layers of the view: where each hangs in the tree of frames, and which a step shows."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Layer:
    """A group of nodes switched as one. node: its name in the tree, which mirrors the frames. title: for people."""

    node: str
    title: str


LAYERS: dict[str, Layer] = {
    "axes": Layer("/base/axes", "Frames"),
    "cad": Layer("/base/partnom/cad", "Part (CAD)"),
    "ghost": Layer("/base/partnom/ghost", "Part, transparent"),
    "surface": Layer("/base/partnom/surface", "Inspection surface"),
    "regions": Layer("/base/partnom/regions", "Keep-outs, line drawn"),
    "coverage": Layer("/base/partnom/coverage", "Coverage of the alignment scan"),
    "keypoints": Layer("/base/partnom/keypoints", "Key points"),
    "alignment": Layer("/base/partnom/alignment", "Alignment path"),
    "inspection": Layer("/base/partnom/inspection", "Inspection raster"),
    "probe": Layer("/base/partnom/probe", "Probe"),
    "scan": Layer("/base/scan", "Scan points"),
    "before": Layer("/base/partnom/deviation", "Deviation before"),
    "found": Layer("/base/part/cad", "Part as found"),
    "after": Layer("/base/part/deviation", "Deviation after"),
    "corrected": Layer("/base/part/corrected", "Corrected raster"),
}

STEPS: dict[str, tuple[str, ...]] = {
    "part": ("axes", "cad"),
    "cell": ("axes", "cad"),
    "surface": ("cad", "surface", "regions"),
    "keypoints": ("cad", "surface", "regions", "coverage", "keypoints"),
    "paths": ("cad", "regions", "inspection", "probe"),
    "programs": ("cad", "alignment", "keypoints"),
    # The part stands somewhere else than the CAD: its points may lie inside.
    "scan": ("ghost", "keypoints", "scan"),
    "alignment": ("found", "after", "keypoints"),
    "report": ("found", "after"),
}
UNFOUND = ("ghost", "keypoints", "scan")
"""What a step about the found part shows while there is none."""

FRAMES = ("/base", "/base/partnom", "/base/part")


def layers_of(step: str, found: bool = True) -> frozenset[str]:
    """Return the layers a step shows; `found`: whether an alignment has found the part."""
    if not found and "found" in STEPS.get(step, ()):
        return frozenset(UNFOUND)
    return frozenset(STEPS.get(step, STEPS["part"]))
