"""What requests about accounts may hold."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from sagittal.server.api.account import account_schemas as schemas
from sagittal.server.auth.api_tokens import MOST_DAYS
from sagittal.server.auth.passwords import MAX_LENGTH, MIN_LENGTH

LONG = "x" * MIN_LENGTH


def takes(kind: type[Any], **body: Any) -> bool:
    try:
        kind.model_validate(body)
    except ValidationError:
        return False
    return True


@pytest.mark.parametrize(
    ("name", "good"),
    [
        ("anna", True),
        ("a", True),
        ("7.of-9_x@clinic", True),
        ("x" * 64, True),
        ("x" * 65, False),
        ("", False),
        ("Anna", False),
        (".anna", False),
        ("anna maria", False),
        ("änne", False),
        ("anna\n", False),
    ],
)
def test_a_sign_in_name_is_small_and_plain(name: str, good: bool) -> None:
    assert takes(schemas.SetUp, name=name, password=LONG) == good
    assert takes(schemas.UserNew, name=name, password=LONG, role="viewer") == good


@pytest.mark.parametrize(
    ("length", "good"),
    [(MIN_LENGTH - 1, False), (MIN_LENGTH, True), (MAX_LENGTH, True), (MAX_LENGTH + 1, False)],
)
def test_a_new_password_is_neither_short_nor_endless(length: int, good: bool) -> None:
    assert takes(schemas.UserChange, password="x" * length) == good
    assert takes(schemas.PasswordChange, current="x", password="x" * length) == good


def test_an_old_password_may_be_short() -> None:
    """A rule that came later must not keep people out."""
    assert takes(schemas.SignIn, name="anna", password="x")
    assert takes(schemas.PasswordProof, password="")
    assert not takes(schemas.PasswordProof, password="x" * 1001)


def test_a_change_names_only_what_was_sent() -> None:
    sent = schemas.UserChange.model_validate({"active": False}).model_dump(exclude_unset=True)
    assert sent == {"active": False}
    assert not takes(schemas.UserChange, name="other")
    assert not takes(schemas.UserChange, role="owner")


@pytest.mark.parametrize(
    ("changed", "good"),
    [
        ({}, True),
        ({"name": " Matlab "}, True),
        ({"name": " "}, False),
        ({"name": "x" * 41}, False),
        ({"scopes": []}, False),
        ({"scopes": ["everything"]}, False),
        ({"days": 0}, False),
        ({"days": MOST_DAYS}, True),
        ({"days": MOST_DAYS + 1}, False),
    ],
)
def test_a_token_is_for_something_and_for_a_time(changed: dict[str, Any], good: bool) -> None:
    assert (
        takes(
            schemas.ApiTokenNew,
            **{"name": "Matlab", "scopes": ["read"], "days": 1, "password": "x", **changed},
        )
        == good
    )


def test_names_of_keys_and_tokens_lose_the_space_around_them() -> None:
    assert schemas.KeyNew.model_validate({"name": " blue ", "key": {}}).name == "blue"


def test_keys_alone_need_both_proofs() -> None:
    pair = {"password": "x", "code": "123456"}
    assert takes(schemas.KeysOnly, on=True, **pair)
    for missing in pair:
        assert not takes(schemas.KeysOnly, on=True, **{k: v for k, v in pair.items() if k != missing})
    assert not takes(schemas.CodeProof, code="")


def test_a_form_has_no_key_and_a_language_is_one_we_speak() -> None:
    assert takes(schemas.SignIn, name="a", password="b", key={"id": "x"})
    assert not takes(schemas.SignInForm, name="a", password="b", key={"id": "x"})
    assert [takes(schemas.LanguageChoice, language=x) for x in ("en", "de", None, "fr")] == [
        True,
        True,
        True,
        False,
    ]
