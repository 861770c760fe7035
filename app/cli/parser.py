"""The commands and their options. Nothing heavy is imported here: `--help` answers at once."""

import argparse
from pathlib import Path

UNITS = ("mm", "cm", "m", "inch")


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Return the parsed command line; exits with 2 on a usage error, as argparse does."""
    return build_parser().parse_args(argv)


def build_parser() -> argparse.ArgumentParser:
    """Return the whole parser."""
    parser = argparse.ArgumentParser(
        prog="echobase",
        description="Plan a robotic ultrasonic inspection from CAD, find the real part by an alignment scan, "
        "and write the KRL program with the corrected BASE.",
        epilog="Exit status: 0 done, 1 the work failed (the issues say why), 2 wrong usage.",
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    for add in (_demo, _plan, _simulate, _align, _batch, _assess, _check, _calibrate, _robot, _reproduce, _serve):
        add(commands)
    return parser


def _command(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str
) -> argparse.ArgumentParser:
    sub = commands.add_parser(name, help=text, description=text[:1].upper() + text[1:] + ".")
    sub.add_argument("--json", action="store_true", help="print one JSON object instead of text")
    return sub


def _numbers(count: int, what: str):  # type: ignore[no-untyped-def]
    def convert(text: str) -> tuple[float, ...]:
        from app.inputs import numbers  # noqa: PLC0415

        try:
            return numbers(text, count, what)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return convert


def _share(text: str) -> float:
    value = float(text)
    if not 0.0 <= value < 1.0:
        raise argparse.ArgumentTypeError("a share from 0 to below 1 is needed")
    return value


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < 1e4:
        raise argparse.ArgumentTypeError("a length above 0 mm is needed")
    return value


def _demo(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(commands, "demo", "the whole main job on a sample part, with the simulated scanner")
    sub.add_argument("--part", choices=("aerofoil", "flat-plate"), default="aerofoil")
    sub.add_argument("-o", "--output", type=Path, default=Path("demo"), metavar="DIR")


def _plan(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(
        commands, "plan", "plan the alignment scan and the inspection of a part, and write both KRL programs"
    )
    sub.add_argument("part", type=Path, metavar="PART", help="STEP, STL, OBJ, PLY or GLB")
    sub.add_argument("--unit", choices=UNITS, help="unit of an STL, OBJ or PLY file (never guessed)")
    sub.add_argument(
        "--setup", type=Path, metavar="setup.json", help="the cell and the procedure; default: the paper's cell"
    )
    sub.add_argument(
        "--patch",
        type=Path,
        action="append",
        default=[],
        metavar="patch.json",
        help="fields of setup.json to change, as `echobase calibrate -o` and `batch` write them; again for each",
    )
    sub.add_argument(
        "--keypoints", type=Path, metavar="keypoints.json", help="key points in CAD mm; default: suggested"
    )
    sub.add_argument(
        "--box",
        type=_numbers(6, "--box"),
        metavar="X0,Y0,Z0,X1,Y1,Z1",
        help="only what of the surface lies in this box is inspected, CAD mm (inspection.box of the setup)",
    )
    sub.add_argument(
        "--seed",
        type=_numbers(3, "--seed"),
        action="append",
        default=[],
        metavar="X,Y,Z",
        help="a point on the surface, CAD mm",
    )
    sub.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")


def _simulate(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(commands, "simulate", "run an exported program on the simulated scanner")
    sub.add_argument("directory", type=Path, metavar="DIR", help="folder written by `echobase plan`")
    sub.add_argument(
        "--offset",
        type=_numbers(6, "--offset"),
        required=True,
        metavar="X,Y,Z,A,B,C",
        help="hidden T_base_basecorr, mm and deg",
    )
    sub.add_argument(
        "--spring-back", type=float, default=0.0, metavar="MM", help="largest displacement along the normal"
    )
    sub.add_argument("--seed", type=int, default=0, metavar="N")
    sub.add_argument("--path", choices=("alignment", "inspection", "corrected"), default="alignment")
    sub.add_argument("--outliers", type=_share, default=0.0, metavar="F", help="share of false echoes")
    sub.add_argument("--dropouts", type=_share, default=0.0, metavar="F", help="share of lost echoes")
    sub.add_argument("--latency-ms", type=float, default=0.0, metavar="T", help="poses recorded too late by T")
    sub.add_argument("-o", "--output", type=Path, required=True, metavar="scan.csv")


def _align(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(commands, "align", "find the part from scan data and write the corrected inspection program")
    sub.add_argument("directory", type=Path, metavar="DIR", help="folder written by `echobase plan`")
    sub.add_argument("scans", type=Path, nargs="+", metavar="SCAN")
    sub.add_argument("--method", choices=("map", "keypoints"), default="map")
    _how_aligned(sub)
    sub.add_argument(
        "--with",
        dest="together",
        type=Path,
        nargs="+",
        action=_Together,
        default=[],
        metavar=("DIR SCAN", "SCAN"),
        help="another plan of the same part and its scans: all scans together determine one correction, for every plan's "
        "inspection; again for each further plan",
    )
    _record(sub)


class _Together(argparse.Action):
    """Collects plan folders with their scans; a folder without a scan is wrong usage."""

    def __call__(self, parser, namespace, values, option_string=None) -> None:  # type: ignore[no-untyped-def]
        if len(values) < 2:
            parser.error("--with needs the folder of a plan and at least one scan of it")
        setattr(namespace, self.dest, [*getattr(namespace, self.dest), values])


def _how_aligned(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--edges", action=argparse.BooleanOptionalAction, default=None, help="default: wherever the scan crosses them"
    )
    sub.add_argument(
        "--non-rigid", dest="non_rigid", action="store_true", help="adapt the poses to a part that sprang back"
    )
    sub.add_argument("--rigid", dest="non_rigid", action="store_false", help="correct BASE only (default)")
    sub.set_defaults(non_rigid=False)
    sub.add_argument("--base", choices=("nominal", "corrected"), help="BASE that was active, for files that cannot say")


def _batch(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(commands, "batch", "compare serial parts on one fixture: what is common, what is each part's own")
    sub.add_argument("directory", type=Path, metavar="DIR", help="folder written by `echobase plan`")
    sub.add_argument(
        "parts",
        type=Path,
        nargs="+",
        metavar="PART",
        help="one part each: correction.json, a folder that holds it, or a scan that is aligned now",
    )
    sub.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="patch.json",
        help="write the patch of setup.json here too (DIR/batch/patch.json)",
    )
    _how_aligned(sub)


def _record(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--record",
        type=Path,
        metavar="record.json",
        help="who, by which procedure, with what (docs/report.md); default: record.json in DIR",
    )


def _assess(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(commands, "assess", "judge an uploaded inspection scan against the plan")
    sub.add_argument("directory", type=Path, metavar="DIR", help="folder written by `echobase plan`")
    sub.add_argument("scans", type=Path, nargs="+", metavar="SCAN", help="an inspection scan, in one file or more")
    sub.add_argument(
        "--before",
        type=Path,
        action="append",
        default=[],
        metavar="SCAN",
        help="the inspection scan from before the correction; again for each of its files",
    )
    sub.add_argument(
        "--base", choices=("nominal", "corrected"), help="BASE that was active in SCAN, for files that cannot say"
    )
    sub.add_argument(
        "--before-base", choices=("nominal", "corrected"), help="BASE that was active in the scan from before"
    )
    _record(sub)


def _check(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(commands, "check", "read KRL back and print what is wrong")
    sub.add_argument("files", type=Path, nargs="+", metavar="FILE", help=".src and .dat files")


def _calibrate(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(commands, "calibrate", "tilt loss, couplant or TCP from measurements; prints a patch of setup.json")
    sub.add_argument("kind", choices=("tilt", "couplant", "tcp"))
    sub.add_argument("files", type=Path, nargs="+", metavar="FILE")
    sub.add_argument(
        "--target", choices=("plane", "sphere"), default="plane", help="tcp: the fixed target that was scanned"
    )
    sub.add_argument("--radius-mm", type=_positive, metavar="R", help="tcp: radius of the sphere; default: to be found")
    sub.add_argument("--setup", type=Path, metavar="setup.json", help="the cell as it is believed to be")
    sub.add_argument("-o", "--output", type=Path, metavar="patch.json", help="write the patch of setup.json here")
    sub.add_argument(
        "--report", type=Path, metavar="calibration.html", help="write the report, with the curves drawn, here"
    )


def _robot(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(commands, "robot", "robot, tools, bases and HOME from a controller's own backup")
    sub.add_argument("files", type=Path, nargs="+", metavar="FILE", help="$machine.dat and $config.dat")
    sub.add_argument(
        "-o", "--output", type=Path, default=Path("robots"), metavar="DIR", help="folder of your robot files"
    )


def _reproduce(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = _command(commands, "reproduce", "print the paper's tables beside ours (simulated)")
    sub.add_argument("experiment", choices=("flat-plate", "aerofoil"))
    sub.add_argument("--seeds", type=int, default=5, metavar="N")


def _serve(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    sub = commands.add_parser("serve", help="open the app in a browser", description="Open the app in a browser.")
    sub.add_argument("--host", default="127.0.0.1")
    sub.add_argument("--port", type=int, default=8000)
    sub.add_argument("--data", type=Path, metavar="DIR", help="where projects are kept")
    sub.set_defaults(json=False)
