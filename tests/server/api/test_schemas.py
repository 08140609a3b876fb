"""What requests may hold: texts, numbers, members."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from sagittal.server.api import schemas
from sagittal.server.sharing.signed_reports import ASSESSMENT_CHARACTERS
from sagittal.server.storage.schema.tables import now

LINE: TypeAdapter[str] = TypeAdapter(schemas.Line)
CODE: TypeAdapter[str] = TypeAdapter(schemas.Code)
NOTE: TypeAdapter[str | None] = TypeAdapter(schemas.Note)
TEXT: TypeAdapter[str] = TypeAdapter(schemas.SomeText)
JOINED = "\u0646\u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645"
"""A Persian word, which needs a joiner."""


def takes(kind: TypeAdapter[Any], value: Any) -> bool:
    try:
        kind.validate_python(value)
    except ValidationError:
        return False
    return True


@pytest.mark.parametrize("text", ["a", "Größe 42", "A  B", "x" * 200, "\U0001f468\u200d\U0001f469", JOINED])
def test_a_line_is_what_can_be_seen(text: str) -> None:
    assert LINE.validate_python(text) == text


@pytest.mark.parametrize(
    "text",
    ["", " ", " a", "a ", "a\nb", "a\tb", "a\x00b", "a\x7fb", "a\x85b", "\xa0a", "x" * 201]
    + [f"a{ch}b" for ch in "\u00ad\u200b\u200e\u200f\u202a\u202e\u2060\u206f\ufeff"],
)
def test_a_line_has_no_end_of_a_line_and_nothing_hidden(text: str) -> None:
    assert not takes(LINE, text)


def test_a_code_has_no_joiner_and_is_short() -> None:
    assert CODE.validate_python("P-0042 ä") == "P-0042 ä"
    assert not takes(CODE, JOINED)
    assert not takes(CODE, "a\u200db")
    assert (takes(CODE, "x" * 64), takes(CODE, "x" * 65)) == (True, False)


def test_a_note_has_lines_and_may_be_nothing() -> None:
    for text in (None, "", "two\nlines\r\n\tindented", "x" * 10_000, JOINED):
        assert takes(NOTE, text)
    for text in ("x" * 10_001, "a\x00", "a\x0bb", "a\u202eb"):
        assert not takes(NOTE, text)


def test_a_text_that_must_be_there_is_not_only_space() -> None:
    assert takes(TEXT, " \n a \n")
    for text in ("", " ", "\n\t ", "\u2003", "a\u200b"):
        assert not takes(TEXT, text)


@pytest.mark.parametrize(
    ("member", "taken", "refused"),
    [
        ("height_m", (0.5, 2.5, None), (0.49, 2.51, float("nan"), float("inf"))),
        ("birth_year", (1850, now().year, None), (1849, now().year + 1, 1960.5)),
        ("affected_side", ("left", "right", None), ("both", "")),
        ("sex", ("female", "male", None), ("x",)),
    ],
)
def test_figures_of_a_patient_are_within_what_people_have(
    member: str, taken: tuple[Any, ...], refused: tuple[Any, ...]
) -> None:
    for value in taken:
        assert getattr(schemas.PatientNew.model_validate({"code": "P", member: value}), member) == value
    for value in refused:
        with pytest.raises(ValidationError):
            schemas.PatientNew.model_validate({"code": "P", member: value})


def test_a_misspelt_member_is_refused() -> None:
    with pytest.raises(ValidationError, match="heigth_m"):
        schemas.PatientNew.model_validate({"code": "P", "heigth_m": 1.7})


def test_only_what_was_sent_is_a_value_and_no_note_is_an_empty_one() -> None:
    assert schemas.PatientChange.model_validate({}).values() == {}
    assert schemas.PatientChange.model_validate({"sex": None}).values() == {"sex": None}
    assert schemas.PatientChange.model_validate({"note": None}).values() == {"note": ""}
    assert schemas.PatientChange.model_validate({"note": "x"}).values() == {"note": "x"}


def test_an_answer_takes_what_it_names_and_others_before_that() -> None:
    @dataclass(frozen=True)
    class Row:
        seq: int = 3
        hash: str = "ab"
        secret: str = "kept"

    assert schemas.make_answer(schemas.AuditHead, Row()) == schemas.AuditHead(3, "ab")
    assert schemas.make_answer(schemas.AuditHead, Row(), hash="cd") == schemas.AuditHead(3, "cd")
    with pytest.raises(AttributeError, match="on"):
        schemas.make_answer(schemas.CareTeams, Row())


@pytest.mark.parametrize(
    ("kind", "taken", "refused"),
    [
        (schemas.ReportLinkNew, [{}, {"days": 1}], [{"days": 0}, {"days": 100_000}]),
        (schemas.VideoAlignment, [{"offset_s": None}, {"offset_s": -1.5}], [{}, {"offset_s": float("nan")}]),
        (
            schemas.EmergencyOpening,
            [{"code": "P", "reason": "Fell in the corridor."}],
            [{"code": "P", "reason": ""}],
        ),
        (schemas.CareTeamChange, [{"users": ["0" * 32]}], [{"users": ["0" * 31]}, {"users": ["G" * 32]}]),
        (
            schemas.Assessment,
            [{"content": None}, {"content": "x" * ASSESSMENT_CHARACTERS}],
            [{}, {"content": "\x00"}],
        ),
        (
            schemas.TuningNew,
            [{"algorithm": "madgwick", "validation": ["walk 2"], "seed": 2**32 - 1}],
            [
                {"algorithm": "madgwick", "validation": []},
                {"algorithm": "madgwick", "validation": ["a"], "seed": 2**32},
                {"algorithm": "madgwick", "validation": ["a"], "particles": 0},
            ],
        ),
    ],
)
def test_requests_end_at_their_limits(
    kind: type[schemas.Request], taken: list[dict[str, Any]], refused: list[dict[str, Any]]
) -> None:
    for body in taken:
        kind.model_validate(body)
    for body in refused:
        with pytest.raises(ValidationError):
            kind.model_validate(body)
