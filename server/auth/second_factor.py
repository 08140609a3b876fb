"""Two-factor authentication: a six-digit code that changes every 30 s (TOTP, RFC 6238).

Secrets are stored encrypted. The key is a file next to the database, so a copy of the database alone is not
enough to decrypt them. The key is created with the first secret; if secrets exist, a missing key is an error.
Each code is accepted once: the time step of the newest accepted code is stored, and only later ones are
valid. Recovery codes are stored as hashes and can be used once.
"""

from __future__ import annotations

import logging
import secrets
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import pyotp
import pyrage
import segno
from sqlalchemy import Connection, delete, insert, select, update

from sagittal.server.auth.tokens import token_hash
from sagittal.server.http.problems import Problem
from sagittal.server.storage.archive import BackupFileError, make_key, read_key
from sagittal.server.storage.schema.person_tables import second_factor, security_key, security_key_challenge
from sagittal.server.storage.schema.tables import now

log = logging.getLogger(__name__)

STEP_S: Final = 30
DRIFT: Final = 1
"""Tolerated clock offset of a phone, in time steps."""
RECOVERY_CODES: Final = 10
_ALPHABET: Final = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"
_GROUPS, _GROUP = 4, 4
"""A recovery code has 80 random bits, so its plain hash cannot be brute-forced."""


class CodeNeeded(Problem):
    """The password is correct, but the account requires a second factor."""

    def __init__(self) -> None:
        super().__init__(
            401,
            "code_needed",
            "This account has a second factor. Enter the code from your authenticator, or a recovery code.",
        )


class CodeWrong(Problem):
    """The code is incorrect, expired or already used."""

    def __init__(self, status: int) -> None:
        super().__init__(
            status,
            "wrong_code",
            "The code is wrong or has already been used. Wait for the next one; check your phone's clock.",
        )


class KeyOfFactorsUnusable(Problem):
    """The key that decrypts the secrets is missing or does not match."""

    def __init__(self) -> None:
        super().__init__(
            503,
            "second_factor_key_unusable",
            "The encryption key of second factors is missing or wrong and must be restored by the "
            "administrator. Recovery codes still work.",
        )


@dataclass(frozen=True)
class SecondFactorSetUp:
    """Enrolment data for an authenticator, shown once: the secret, its otpauth URI and a QR code of that."""

    secret: str
    address: str
    picture: str


def begin(c: Connection, key_file: Path, user_id: str, name: str) -> SecondFactorSetUp:
    """Create a secret, which takes effect after the first correct code.

    Raises
    ------
    Problem 409 if a second factor is active; KeyOfFactorsUnusable, also if secrets exist without a key.
    """
    if is_on(c, user_id):
        raise Problem(409, "second_factor_on", "A second factor is already set up. Remove it first.")
    secret = pyotp.random_base32()
    c.execute(delete(second_factor).where(second_factor.c.user_id == user_id))
    _make_missing_key(c, key_file)
    sealed = pyrage.encrypt(secret.encode(), [_read_key(key_file).to_public()])
    c.execute(insert(second_factor).values(user_id=user_id, secret=sealed, recovery=[], last_step=0))
    address = pyotp.TOTP(secret, interval=STEP_S).provisioning_uri(name=name, issuer_name="Sagittal")
    return SecondFactorSetUp(secret, address, segno.make(address, error="m").png_data_uri(scale=5, border=4))


def confirm(c: Connection, key_file: Path, user_id: str, code: str, at_s: float | None = None) -> list[str]:
    """Activate the second factor; return the recovery codes, which are shown only once. Raises CodeWrong."""
    if is_on(c, user_id) or not _take_code(c, key_file, user_id, code, at_s):
        raise CodeWrong(403)
    codes = ["-".join(_random_group() for _ in range(_GROUPS)) for _ in range(RECOVERY_CODES)]
    c.execute(
        update(second_factor)
        .where(second_factor.c.user_id == user_id)
        .values(confirmed_at=now(), recovery=[token_hash(code) for code in codes])
    )
    return codes


def is_on(c: Connection, user_id: str) -> bool:
    """Whether this account requires a second factor."""
    query = select(second_factor.c.confirmed_at).where(second_factor.c.user_id == user_id)
    return c.execute(query).scalar() is not None


def list_users(c: Connection) -> set[str]:
    """Ids of the accounts that require a second factor."""
    query = select(second_factor.c.user_id).where(second_factor.c.confirmed_at.is_not(None))
    return set(c.execute(query).scalars())


def use(c: Connection, key_file: Path, user_id: str, code: str, at_s: float | None = None) -> bool:
    """Consume a current code or a recovery code (writes); False if it is neither.

    Accounts that accept security keys only can use recovery codes but no codes of an authenticator.
    """
    if not takes_keys_only(c, user_id) and _take_code(c, key_file, user_id, code, at_s):
        return True
    return _take_recovery(c, user_id, code)


def takes_keys_only(c: Connection, user_id: str) -> bool:
    """Whether codes of an authenticator are rejected for this account, as a phishing page could
    request them.
    """
    query = select(second_factor.c.keys_only).where(second_factor.c.user_id == user_id)
    return bool(c.execute(query).scalar())


def take_keys_only(c: Connection, user_id: str, only: bool) -> None:
    """Switch between security keys and recovery codes only, and authenticator codes as well."""
    mine = second_factor.c.user_id == user_id
    c.execute(update(second_factor).where(mine).values(keys_only=only))


def count_recovery(c: Connection, user_id: str) -> int:
    """Number of unused recovery codes."""
    query = select(second_factor.c.recovery).where(second_factor.c.user_id == user_id)
    return len(c.execute(query).scalar() or ())


def remove(c: Connection, user_id: str) -> bool:
    """Remove codes and security keys of an account; False if it has none."""
    for table in (security_key, security_key_challenge):
        c.execute(delete(table).where(table.c.user_id == user_id))
    return bool(c.execute(delete(second_factor).where(second_factor.c.user_id == user_id)).rowcount)


def _take_code(c: Connection, key_file: Path, user_id: str, code: str, at_s: float | None) -> bool:
    row = c.execute(select(second_factor).where(second_factor.c.user_id == user_id)).one_or_none()
    figures = code.replace(" ", "")
    if row is None or not (figures.isascii() and figures.isdigit()):
        return False
    totp = pyotp.TOTP(_open(_read_key(key_file), row.secret), interval=STEP_S)
    step = int(time.time() if at_s is None else at_s) // STEP_S
    for one in range(step - DRIFT, step + DRIFT + 1):
        if one > row.last_step and secrets.compare_digest(totp.generate_otp(one), figures):
            mine = second_factor.c.user_id == user_id
            c.execute(update(second_factor).where(mine).values(last_step=one))
            return True
    return False


def _take_recovery(c: Connection, user_id: str, code: str) -> bool:
    digest = token_hash(code.strip().upper())
    mine = second_factor.c.user_id == user_id
    left = list(c.execute(select(second_factor.c.recovery).where(mine)).scalar() or ())
    if digest not in left:
        return False
    left.remove(digest)
    c.execute(update(second_factor).where(mine).values(recovery=left))
    return True


def _random_group() -> str:
    return "".join(secrets.choice(_ALPHABET) for _ in range(_GROUP))


def find_problems(c: Connection, key_file: Path) -> list[str]:
    """One sentence for each user whose secret cannot be decrypted, or a single one if the key is unusable."""
    rows = c.execute(select(second_factor.c.user_id, second_factor.c.secret)).all()
    if not rows:
        return []
    try:
        key = _read_key(key_file)
    except KeyOfFactorsUnusable as error:
        return [f"{key_file}: {error.detail}"]
    problems = []
    for row in rows:
        try:
            _open(key, row.secret)
        except KeyOfFactorsUnusable:
            problems.append(f"the second factor of account {row.user_id} needs another key than {key_file}")
    return problems


def _make_missing_key(c: Connection, path: Path) -> None:
    """Create the key for the first secret; raises KeyOfFactorsUnusable if secrets exist already."""
    if path.exists():
        return
    if c.execute(select(second_factor.c.user_id).where(second_factor.c.confirmed_at.is_not(None))).first():
        raise KeyOfFactorsUnusable
    c.execute(delete(second_factor))  # registered with the lost key and unconfirmed: nobody can confirm them
    make_key(path)


def _read_key(path: Path) -> pyrage.x25519.Identity:
    try:
        key = read_key(path)
    except BackupFileError as error:
        log.error("%s: %s", path, error)
        raise KeyOfFactorsUnusable from error
    if key.private is None:
        log.error("%s holds a public key, which opens nothing", path)
        raise KeyOfFactorsUnusable
    return key.private


def _open(key: pyrage.x25519.Identity, sealed: bytes) -> str:
    try:
        plain: bytes = pyrage.decrypt(sealed, [key])
        return plain.decode()
    except pyrage.DecryptError as error:
        raise KeyOfFactorsUnusable from error
