"""The whole programs kept under tests/golden/krl: the only way to change them is `make golden`."""

from collections.abc import Iterator
from pathlib import Path

from kuka_export.export import export
from kuka_export.options import ProgramOptions
from tests.krl.paths import correction, cylinder, raster, setup

FOLDER = Path(__file__).parents[1] / "golden" / "krl"


def programs() -> Iterator[tuple[str, dict[str, bytes]]]:
    """Yield (folder, files) of every golden program."""
    signals = {"signals": {"data_output": 7, "wait_input": 4}}
    for controller in ("krc2", "krc4", "krc5"):
        taught, untaught = setup(controller), setup(controller, taught=False)
        notes = ("golden",)
        yield (
            f"{controller}/alignment",
            export(raster("alignment", 6, 2, 9.0, 4.0, 2), taught, "EB_GOLD_AL", "gold part", notes=notes).files,
        )
        yield f"{controller}/inspection", export(cylinder(data=9, passes=2), taught, "EB_GOLD_IN", "gold part").files
        corrected = export(cylinder(data=9, passes=2), taught, "EB_GOLD_IN", "gold part", T_base_basecorr=correction())
        yield f"{controller}/corrected", corrected.files
        loose = export(cylinder(data=9, passes=2), untaught, "EB_GOLD_UN", "gold part", T_base_basecorr=correction())
        yield f"{controller}/corrected_untaught", loose.files
        options = ProgramOptions(motion="lin", signal="pulse", home=True, operator="A. Person", date="2026-01-31")
        yield (
            f"{controller}/lin_pulse_home",
            export(raster(data=8), setup(controller, **signals), "EB_GOLD_LP", "gold part", options=options).files,
        )


def main() -> None:
    for folder, files in programs():
        place = FOLDER / folder
        place.mkdir(parents=True, exist_ok=True)
        for old in place.iterdir():
            old.unlink()
        for name, data in files.items():
            (place / name).write_bytes(data)


if __name__ == "__main__":
    main()
