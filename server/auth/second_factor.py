"""A second factor beside the password: a code of six figures that changes every 30 s (TOTP, RFC 6238).

The secret is stored encrypted; its key is a file beside the database, so that a copy of the database alone
opens nothing. The first secret makes the key; beside secrets a missing key is an error. A code is taken once:
the newest step that was taken is stored, and only later ones count. Recovery codes are stored as hashes
and end when used.
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
"""Steps by which a telephone's clock may be off."""
RECOVERY_CODES: Final = 10
_ALPHABET: Final = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"
_GROUPS, _GROUP = 4, 4
"""A recovery code has 80 random bits: its plain hash cannot be searched."""


class CodeNeeded(Problem):
    """The password is right, and the account has a second factor."""

    def __init__(self) -> None:
        super().__init__(
            401,
            "code_needed",
            "This account has a second factor. Give the figures of your authenticator, or a recovery code.",
        )


class CodeWrong(Problem):
    """The code is not the one of this moment, or was used already."""

    def __init__(self, status: int) -> None:
        super().__init__(
            status,
            "wrong_code",
            "The code is wrong or was used already. Wait for the next one; check your telephone's clock.",
        )


class KeyOfFactorsUnusable(Problem):
    """The key that opens the secrets is missing, or is another one."""

    def __init__(self) -> None:
        super().__init__(
            503,
            "second_factor_key_unusable",
            "The key of second factors is missing or wrong. The operator puts it back. "
            "A recovery code still works.",
        )


@dataclass(frozen=True)
class SecondFactorSetUp:
    """What an authenticator needs, shown this once: the secret, its otpauth address, a picture of that."""

    secret: str
    address: str
    picture: str


def begin(c: Connection, key_file: Path, user_id: str, name: str) -> SecondFactorSetUp:
    """Make a secret, which counts from the first right code on.

    Raises
    ------
    Problem 409 where one counts; KeyOfFactorsUnusable, of a key that is missing beside secrets too.
    """
    if is_on(c, user_id):
        raise Problem(409, "second_factor_on", "There is a second factor already. Remove it first.")
    secret = pyotp.random_base32()
    c.execute(delete(second_factor).where(second_factor.c.user_id == user_id))
    _make_missing_key(c, key_file)
    sealed = pyrage.encrypt(secret.encode(), [_read_key(key_file).to_public()])
    c.execute(insert(second_factor).values(user_id=user_id, secret=sealed, recovery=[], last_step=0))
    address = pyotp.TOTP(secret, interval=STEP_S).provisioning_uri(name=name, issuer_name="Sagittal")
    return SecondFactorSetUp(secret, address, segno.make(address, error="m").png_data_uri(scale=5, border=4))


def confirm(c: Connection, key_file: Path, user_id: str, code: str, at_s: float | None = None) -> list[str]:
    """Begin to ask for codes; returns the recovery codes, which are shown this once. Raises CodeWrong."""
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
    """Whether this account needs a code."""
    query = select(second_factor.c.confirmed_at).where(second_factor.c.user_id == user_id)
    return c.execute(query).scalar() is not None


def list_users(c: Connection) -> set[str]:
    """The accounts that need a code."""
    query = select(second_factor.c.user_id).where(second_factor.c.confirmed_at.is_not(None))
    return set(c.execute(query).scalars())


def use(c: Connection, key_file: Path, user_id: str, code: str, at_s: float | None = None) -> bool:
    """Take a code of this moment or a recovery code, once; False when it is neither (writes).

    Of an account that takes security keys only, recovery codes alone.
    """
    if not takes_keys_only(c, user_id) and _take_code(c, key_file, user_id, code, at_s):
        return True
    return _take_recovery(c, user_id, code)


def takes_keys_only(c: Connection, user_id: str) -> bool:
    """Whether figures of the authenticator are not taken: a page that pretends could ask for them."""
    query = select(second_factor.c.keys_only).where(second_factor.c.user_id == user_id)
    return bool(c.execute(query).scalar())


def take_keys_only(c: Connection, user_id: str, only: bool) -> None:
    """Take security keys and recovery codes only, or the figures of the authenticator as well."""
    mine = second_factor.c.user_id == user_id
    c.execute(update(second_factor).where(mine).values(keys_only=only))


def count_recovery(c: Connection, user_id: str) -> int:
    """How many recovery codes have not been used."""
    query = select(second_factor.c.recovery).where(second_factor.c.user_id == user_id)
    return len(c.execute(query).scalar() or ())


def remove(c: Connection, user_id: str) -> bool:
    """Ask for no code and no security key any more; False when none was asked for."""
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
    found = token_hash(code.strip().upper())
    mine = second_factor.c.user_id == user_id
    left = list(c.execute(select(second_factor.c.recovery).where(mine)).scalar() or ())
    if found not in left:
        return False
    left.remove(found)
    c.execute(update(second_factor).where(mine).values(recovery=left))
    return True


def _random_group() -> str:
    return "".join(secrets.choice(_ALPHABET) for _ in range(_GROUP))


def find_problems(c: Connection, key_file: Path) -> list[str]:
    """Whose secret cannot be read by the key, one sentence each; one alone where the key is not usable."""
    rows = c.execute(select(second_factor.c.user_id, second_factor.c.secret)).all()
    if not rows:
        return []
    try:
        key = _read_key(key_file)
    except KeyOfFactorsUnusable as error:
        return [f"{key_file}: {error.detail}"]
    found = []
    for row in rows:
        try:
            _open(key, row.secret)
        except KeyOfFactorsUnusable:
            found.append(f"the second factor of account {row.user_id} needs another key than {key_file}")
    return found


def _make_missing_key(c: Connection, path: Path) -> None:
    """Make the key for the first secret; raises KeyOfFactorsUnusable where there are secrets already."""
    if path.exists():
        return
    if c.execute(select(second_factor.c.user_id).where(second_factor.c.confirmed_at.is_not(None))).first():
        raise KeyOfFactorsUnusable
    c.execute(delete(second_factor))  # set up by the lost key and not proved: nobody can prove them
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
