"""What goes over the wire about accounts: signing in, passwords, second factors, tokens for programs."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, StringConstraints

from sagittal.server.api.schemas import Line, Request
from sagittal.server.auth import api_tokens
from sagittal.server.auth.api_tokens import Scope
from sagittal.server.auth.passwords import MAX_LENGTH, MIN_LENGTH
from sagittal.server.auth.roles import Role

SignInName = Annotated[
    str, StringConstraints(min_length=1, max_length=64, pattern=r"^[a-z0-9][a-z0-9._@-]*$")
]
Password = Annotated[str, StringConstraints(min_length=MIN_LENGTH, max_length=MAX_LENGTH)]


class SignInForm(Request):
    """Name and password, and a code where the account has a second factor."""

    name: Annotated[str, StringConstraints(max_length=200)]
    password: Annotated[str, StringConstraints(max_length=1000)]
    code: Annotated[str, StringConstraints(max_length=40)] | None = None
    next: str | None = Field(default=None, max_length=2000, description="page to go on to (forms)")


class SignIn(SignInForm):
    """The same with what a security key answered in place of the code."""

    key: dict[str, Any] | None = Field(default=None, description="as PublicKeyCredential.toJSON gives it")


class KeyQuestion(Request):
    """Name and password, before a security key is asked for."""

    name: Annotated[str, StringConstraints(max_length=200)]
    password: Annotated[str, StringConstraints(max_length=1000)]


@dataclass(frozen=True)
class KeyOptions:
    """What the browser needs of this server to ask a security key (WebAuthn, as JSON)."""

    options: dict[str, Any]


class KeyNew(Request):
    """A new security key: its name, and what it answered."""

    name: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=40)]
    key: dict[str, Any]


@dataclass(frozen=True)
class SecurityKey:
    """A security key of one's own."""

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
    """One's own new password."""

    current: Annotated[str, StringConstraints(max_length=1000)]
    password: Password


class ApiTokenNew(Request):
    """A token for a program: what for, for how many days, and one's password."""

    name: Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=40)]
    scopes: Annotated[list[Scope], Field(min_length=1, max_length=len(Scope))]
    days: Annotated[int, Field(ge=1, le=api_tokens.MOST_DAYS)]
    password: Annotated[str, StringConstraints(max_length=1000)]


class PasswordProof(Request):
    """One's password, for what a browser left open must not do."""

    password: Annotated[str, StringConstraints(max_length=1000)]


class CodeProof(Request):
    """A code of the authenticator, or a recovery code."""

    code: Annotated[str, StringConstraints(min_length=1, max_length=40)]


class BothProofs(PasswordProof, CodeProof):
    """One's password and a code: what changes by which keys one signs in."""


class KeysOnly(BothProofs):
    """Whether security keys and recovery codes alone are taken."""

    on: bool


class LanguageChoice(Request):
    """In which language one reads the pages."""

    language: Literal["en", "de"] | None


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
    """Who is signed in, and what this person may do."""

    id: str
    name: str
    display_name: str
    role: Role
    actions: list[str]


@dataclass(frozen=True)
class SignInState:
    """Who is signed in, and seconds until that ends if nobody does anything."""

    name: str
    left_s: float


class UserNew(Request):
    """A new account."""

    name: SignInName
    display_name: Line | None = None
    role: Role
    password: Password


class UserChange(Request):
    """What to change of an account; members left out stay as they are."""

    display_name: Line = ""
    role: Role = Role.VIEWER
    active: bool = True
    password: Password = ""


@dataclass(frozen=True)
class ApiToken:
    """A token for a program, without the token itself."""

    id: str
    name: str
    scopes: list[str]
    created_at: dt.datetime
    expires_at: dt.datetime
    used_at: dt.datetime | None


@dataclass(frozen=True)
class NewApiToken(ApiToken):
    """A token that has just been made; it is shown this once."""

    token: str


@dataclass(frozen=True)
class RecoveryCodes:
    """Codes for when the telephone is lost, one a line; shown this once, each works once."""

    codes: str
