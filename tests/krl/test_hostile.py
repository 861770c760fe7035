"""Nothing a user types becomes KRL."""

import pytest

from kuka_export.check import check_files
from kuka_export.export import export
from kuka_export.options import ProgramOptions
from kuka_export.reader import read_program
from tests.krl.paths import correction, raster, setup

HOSTILE = [
    "x\r\n$OUT[1]=TRUE\r\n;",
    "x\n$VEL.CP = 3.0",
    "x\x0b$OUT[2]=TRUE",
    "x\x85$OUT[2]=TRUE",
    "x\u2028LIN {X 0,Y 0,Z 0,A 0,B 0,C 0}\u2029",
    ";ENDFOLD (RUN INFORMATION)",
    ";FOLD INI;%{PE}%R 5.5.32,%MKUKATPBASIS",
    "ENDFOLD",
    "&ACCESS RVO",
    "END\r\nDEF EVIL ( )",
    "DATA ON AT THE NEXT POSE",
    "FOLD PASS 99",
    "\x00\x1a\x08\x7f",
    "\ufeff\u202eevil",
    "%{h}",
    "a" * 100_000,
    "😀" * 200,
    "ｆｕｌｌ　ｗｉｄｔｈ；＄ＯＵＴ［１］＝ＴＲＵＥ",
    "\u037e greek question mark looks like a semicolon",
]


def words(files: dict[str, bytes]) -> list[str]:
    """All lines that are not comments."""
    return [t for data in files.values() for t in data.decode("ascii").split("\r\n") if not t.strip().startswith(";")]


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
@pytest.mark.parametrize("taught", [True, False])
def test_labels_notes_operator_and_date_change_comments_only(text: str, taught: bool):
    s = setup("krc4", taught)
    plain = export(raster(), s, "EB_JOB", T_base_basecorr=correction(), verdict="partial", acceptance="x")
    options = ProgramOptions(operator=text, date=text)
    made = export(
        raster(),
        s,
        "EB_JOB",
        text,
        T_base_basecorr=correction(),
        options=options,
        notes=[text, text],
        verdict="partial",
        acceptance="x " + text,
    )
    assert words(made.files) == words(plain.files)
    assert check_files(made.files, "krc4") == []
    assert max(len(line) for data in made.files.values() for line in data.split(b"\r\n")) < 200
    a, b = read_program(plain.files), read_program(made.files)
    assert (a.path.data_on == b.path.data_on).all()
    assert (a.path.pass_id == b.path.pass_id).all()


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_without_a_data_signal_comments_still_say_where_data_are_taken(text: str):
    options = ProgramOptions(signal="none", operator=text)
    made = export(raster(), setup(), "EB_JOB", text, options=options, notes=[text])
    assert made.proof.ok
