"""Schemas of accounts: sign-in, passwords, second factors and API tokens."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field, StringConstraints

from sagittal.server.api.schemas import Line, Request
from sagittal.server.auth import api_tokens
from sagittal.server.auth.api_tokens import Scope
from sagittal.server.auth.passwords import MAX_LENGTH, MIN_LENGTH
from sagittal.server.auth.roles import Role
from sagittal.web.language import LANGUAGES

SignInName = Annotated[
    str, StringConstraints(min_length=1, max_length=64, pattern=r"^[a-z0-9][a-z0-9._@-]*$")
]
Password = Annotated[str, StringConstraints(min_length=MIN_LENGTH, max_length=MAX_LENGTH)]


class SignInForm(Request):
    """Name and password, and a code if the account has a second factor."""

    name: Annotated[str, StringConstraints(max_length=200)]
    password: Annotated[str, StringConstraints(max_length=1000)]
    code: Annotated[str, StringConstraints(max_length=40)] | None = None
    next: str | None = Field(default=None, max_length=2000, description="page to go on to (forms)")


class SignIn(SignInForm):
    """Credentials with the response of a security key instead of a code."""

    key: dict[str, Any] | None = Field(default=None, description="as PublicKeyCredential.toJSON gives it")


class KeyQuestion(Request):
    """Name and password, submitted before a security key is requested."""

    name: Annotated[str, StringConstraints(max_length=200)]
    password: Annotated[str, StringConstraints(max_length=1000)]


@dataclass(frozen=True)
class KeyOptions:
    """Options with which the browser requests a security key (WebAuthn, as JSON)."""

    options: dict[str, Any]


class KeyNew(Request):
    """A new security key: its name and registration response."""

    name: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=40)]
    key: dict[str, Any]


@dataclass(frozen=True)
class SecurityKey:
    """A security key of the signed-in user."""

    id: str
    name: str
    host: str
    created_at: dt.datetime
    used_at: dt.datetime | None


class SetUp(Request):
    """The first administrator."""

    name: SignInName
    display_name: Line | None = None
    password: Password


class PasswordChange(Request):
    """New password of the signed-in user."""

    current: Annotated[str, StringConstraints(max_length=1000)]
    password: Password


class ApiTokenNew(Request):
    """A new API token: scopes, lifetime in days, and the user's password."""

    name: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=40)]
    scopes: Annotated[list[Scope], Field(min_length=1, max_length=len(Scope))]
    days: Annotated[int, Field(ge=1, le=api_tokens.MOST_DAYS)]
    password: Annotated[str, StringConstraints(max_length=1000)]


class PasswordProof(Request):
    """The user's password, required for sensitive actions."""

    password: Annotated[str, StringConstraints(max_length=1000)]


class CodeProof(Request):
    """A code of the authenticator, or a recovery code."""

    code: Annotated[str, StringConstraints(min_length=1, max_length=40)]


class BothProofs(PasswordProof, CodeProof):
    """Password and code, required to change security keys."""


class KeysOnly(BothProofs):
    """Whether only security keys and recovery codes are accepted."""

    on: bool


class LanguageChoice(Request):
    """Language of the pages."""

    language: Annotated[str, StringConstraints(pattern=f"^({'|'.join(LANGUAGES)})$")] | None


@dataclass(frozen=True)
class User:
    """An account."""

    id: str
    name: str
    display_name: str
    role: Role
    active: bool
    created_at: dt.datetime


@dataclass(frozen=True)
class Account:
    """The signed-in user and the permitted actions."""

    id: str
    name: str
    display_name: str
    role: Role
    actions: list[str]


@dataclass(frozen=True)
class SignInState:
    """The signed-in user, and seconds until the sign-in expires without activity."""

    name: str
    left_s: float


class UserNew(Request):
    """A new account."""

    name: SignInName
    display_name: Line | None = None
    role: Role
    password: Password


class UserChange(Request):
    """Changes to an account; omitted fields are unchanged."""

    display_name: Line = ""
    role: Role = Role.VIEWER
    active: bool = True
    password: Password = ""


@dataclass(frozen=True)
class ApiToken:
    """An API token, without the secret."""

    id: str
    name: str
    scopes: list[str]
    created_at: dt.datetime
    expires_at: dt.datetime
    used_at: dt.datetime | None


@dataclass(frozen=True)
class NewApiToken(ApiToken):
    """A newly created token, shown only once."""

    token: str


@dataclass(frozen=True)
class RecoveryCodes:
    """Single-use codes in case the phone is lost, shown only once."""

    codes: str
