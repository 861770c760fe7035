"""`echobase check`: what must be refused is, for the reason meant; what other people write legally is not."""

import pytest

from kuka_export.check import check_files
from kuka_export.rules.finding import RULES
from planner.issues import errors_in
from tests.krl.negative import NEGATIVE, NEGATIVE_KRC2, Case
from tests.krl.positive import POSITIVE


def encoded(files: dict[str, str]) -> dict[str, bytes]:
    return {name: text.replace("\n", "\r\n").encode("utf-8") for name, text in files.items()}


def test_the_negative_corpus_is_large_and_has_no_double():
    assert len(NEGATIVE) >= 80
    assert len({c.name for c in NEGATIVE}) == len(NEGATIVE)


@pytest.mark.parametrize("case", NEGATIVE, ids=lambda c: c.name)
def test_what_breaks_a_rule_is_refused_for_that_rule(case: Case):
    errors = errors_in(check_files(encoded(case.files)))
    assert case.rule in {e.code for e in errors}, [e.sentence() for e in errors]
    hit = next(e for e in errors if e.code == case.rule)
    assert hit.remedy
    assert ":" in hit.where
    assert (f"(KSS {case.kss})" in hit.message) == (case.kss is not None)


@pytest.mark.parametrize("case", NEGATIVE, ids=lambda c: c.name)
def test_one_fault_is_one_finding(case: Case):
    # A fault that drags others behind it hides the one to mend: at most two error lines for one planted fault.
    assert 1 <= len(errors_in(check_files(encoded(case.files)))) <= 2


@pytest.mark.parametrize("case", NEGATIVE_KRC2, ids=lambda c: c.name)
def test_words_and_limits_of_the_controller(case: Case):
    assert case.rule in {e.code for e in errors_in(check_files(encoded(case.files), "krc2"))}
    assert errors_in(check_files(encoded(case.files))) == []


@pytest.mark.parametrize("name", POSITIVE)
def test_legal_programs_of_others_pass(name: str):
    issues = check_files(encoded(POSITIVE[name]))
    assert [e.sentence() for e in errors_in(issues)] == []


def test_every_code_has_a_rule_with_a_remedy():
    assert all(rule.remedy for rule in RULES.values())
    assert {c.rule for c in NEGATIVE} <= set(RULES)


def test_a_name_that_no_file_declares_is_a_warning_and_says_so_once():
    text = "DEF JOB ( )\nMYSTERY (1)\nMYSTERY (2)\nMYFLAG = TRUE\nEND\n"
    issues = check_files(encoded({"JOB.src": text}))
    assert [(i.severity, i.where) for i in issues if i.code == "krl-undeclared"] == [
        ("warning", "JOB.src:2"),
        ("warning", "JOB.src:4"),
    ]


def test_lines_that_git_normalised_are_a_warning_only():
    issues = check_files({"JOB.src": b"DEF JOB ( )\nHALT\nEND\n"})
    assert [i.code for i in issues] == ["krl-line-ends"]
    assert errors_in(issues) == []


def test_mixed_motion_families_are_a_warning():
    moves = [f"{word} {{X {k}.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}" for k, word in enumerate(("LIN", "LIN", "SLIN"))]
    text = "\n".join(["DEF JOB ( )", *moves, "END", ""])
    assert "krl-mixed-families" in {i.code for i in check_files(encoded({"JOB.src": text})) if i.severity == "warning"}


def test_no_files_is_an_error():
    assert [i.code for i in check_files({"readme.txt": b"hello"})] == ["krl-no-files"]


def test_the_same_module_given_twice_is_no_fault():
    text = b"DEF JOB ( )\r\nHALT\r\nEND\r\n"
    assert check_files({"a/JOB.src": text, "b/JOB.src": text}) == []
