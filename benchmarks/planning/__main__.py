"""`python -m benchmarks.planning`: the table."""

import time

from benchmarks.planning.measure import Row, run, trimesh_seconds
from benchmarks.planning.panels import panels

HEAD = (
    f"{'panel':28s}{'strategy':10s}{'tris':>8s}{'passes':>7s}{'poses':>8s}{'n p99':>8s}{'pitch p1-p99':>14s}{'missed':>8s}"
    f"{'surface':>9s}{'raster':>8s}{'cover':>7s}{'kept':>7s}{'chord':>13s}{'spline':>13s}{'thin':>6s}"
)
UNITS = (
    f"{'':28s}{'':10s}{'':>8s}{'':>7s}{'':>8s}{'deg':>8s}{'mm':>14s}{'mm2':>8s}{'s':>9s}{'s':>8s}{'s':>7s}{'':>7s}"
    f"{'mm / deg':>13s}{'mm / deg':>13s}{'s':>6s}"
)


def line(r: Row) -> str:
    """Return one row of the table."""
    d = r.deviation
    return (
        f"{r.panel:28s}{r.strategy:10s}{r.triangles:8d}{r.passes:7d}{r.poses:8d}{r.normal_p99_deg:8.4f}"
        f"{r.pitch_low_mm:7.3f}-{r.pitch_high_mm:6.3f}{r.missed_mm2:8.0f}{r.surface_s:9.2f}{r.raster_s:8.2f}"
        f"{r.coverage_s:7.2f}{r.kept:7d}{d[0]:7.3f}/{d[1]:5.3f}{d[2]:7.3f}/{d[3]:5.3f}{r.decimate_s:6.2f}"
    )


def main() -> None:
    """Print accuracy and times of all panels, 2 mm pitch and step."""
    begin = time.perf_counter()
    print(
        "2 mm pitch, 2 mm step, 3 mm beam; truth = the analytic surface; missed = not within tolerance, edge margin apart"
    )
    print(HEAD)
    print(UNITS)
    every = panels()
    for panel in every:
        for row in run(panel):
            print(line(row), flush=True)
    theirs, ours = trimesh_seconds(every[1], 2.0)
    print(f"slicing alone, {every[1].name}: trimesh {theirs:.2f} s, EchoBase {ours:.2f} s, {theirs / ours:.1f}x")
    print(f"{time.perf_counter() - begin:.0f} s in all")


if __name__ == "__main__":
    main()
