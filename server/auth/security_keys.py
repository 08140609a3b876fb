"""Security keys as a second factor (WebAuthn, W3C Level 2): registration, sign-in and removal.

A key signs a challenge for the name of this host only, and is accepted only at the port where it was
registered: a phishing page, or another service on the same host, obtains nothing it can use. A
challenge is random, bound to one account and one purpose, valid for five minutes and one use; the
database stores its hash. An account needs the codes of server/auth/second_factor.py before it can
register a key, so that a user who loses a key can sign in with a recovery code.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import json
import logging
import secrets
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

from sqlalchemy import Connection, Row, delete, insert, select, update
from starlette.requests import HTTPConnection

from sagittal.core.message import Message
from sagittal.server.auth import second_factor
from sagittal.server.auth.tokens import token_hash
from sagittal.server.http.hosts import host_name
from sagittal.server.http.problems import Problem
from sagittal.server.storage.schema.person_tables import security_key, security_key_challenge
from sagittal.server.storage.schema.tables import new_id, now

log = logging.getLogger(__name__)

CHALLENGE_LIFE: Final = dt.timedelta(minutes=5)
MOST_KEYS: Final = 10
"""Per account."""
_MOST_WAITING: Final = 20
"""Pending challenges per account; the oldest is dropped."""
_LONGEST_ADDRESS: Final = 255
"""Characters of `security_key.host`."""
Purpose = Literal["register", "sign_in"]


@dataclass(frozen=True)
class Site:
    """Host name and origin (scheme, host, port) under which the browser reaches this server."""

    host: str
    origin: str

    @property
    def address(self) -> str:
        """Host name and port. Browsers distinguish keys by host name only; another port is another
        service.
        """
        return self.origin.partition("://")[2]

    @property
    def has_keys(self) -> bool:
        """Whether browsers support security keys here: over HTTPS or on localhost, and not for IP
        addresses.
        """
        is_figures = ":" in self.host or self.host.replace(".", "").isdigit()
        is_short = len(self.address) <= _LONGEST_ADDRESS
        return is_short and not is_figures and (self.origin.startswith("https:") or self.host == "localhost")


def site_of(connection: HTTPConnection, *, behind_tls: bool) -> Site:
    """Site of a request; its host name has been checked against the allow-list (server/http/hosts.py)."""
    host = connection.headers.get("host", "").strip().lower()
    return Site(host_name(host), f"{'https' if behind_tls else 'http'}://{host}")


class KeyRefused(Problem):
    """The response of a key does not prove that it belongs to this account."""

    def __init__(self, status: int) -> None:
        super().__init__(
            status,
            "key_refused",
            "The security key was not accepted. Use one that is set up for you, and try again.",
        )


def list_keys(c: Connection, user_id: str) -> Sequence[Row[Any]]:
    """Security keys of an account, oldest first."""
    mine = select(security_key).where(security_key.c.user_id == user_id)
    return c.execute(mine.order_by(security_key.c.created_at, security_key.c.id)).all()


def list_usable(c: Connection, site: Site, user_id: str) -> Sequence[Row[Any]]:
    """Security keys of an account that were registered at this address."""
    return [key for key in list_keys(c, user_id) if site.has_keys and key.host == site.address]


def begin_registration(c: Connection, site: Site, user_id: str, name: str) -> dict[str, Any]:
    """Options for registering a key; raises Problem 409 without a second factor, or for more than ten
    keys.
    """
    from webauthn import generate_registration_options, options_to_json
    from webauthn.helpers.structs import PublicKeyCredentialDescriptor

    if not site.has_keys:
        raise Problem(
            409,
            "no_keys_here",
            "Security keys require an https address with a host name, or localhost.",
        )
    if not second_factor.is_on(c, user_id):
        raise Problem(
            409,
            "second_factor_off",
            "Set up the authenticator first: its recovery codes help when a key is lost.",
        )
    keys = list_keys(c, user_id)
    if len(keys) >= MOST_KEYS:
        raise Problem(
            409,
            "too_many_keys",
            Message("An account has at most {MOST_KEYS} keys. Remove one first.", MOST_KEYS=MOST_KEYS),
        )
    options = generate_registration_options(
        rp_id=site.host,
        rp_name="Sagittal",
        user_name=name,
        user_id=bytes.fromhex(user_id),
        challenge=_new_challenge(c, user_id, "register"),
        exclude_credentials=[PublicKeyCredentialDescriptor(k.credential_id) for k in keys],
    )
    return _as_tree(options_to_json(options))


def take_challenge(c: Connection, user_id: str, purpose: Purpose, answer: Mapping[str, Any]) -> bytes | None:
    """Consume the challenge of a response; None if it was not issued to this account for this purpose."""
    from webauthn import base64url_to_bytes

    try:
        client_data = json.loads(base64url_to_bytes(str(answer["response"]["clientDataJSON"])))
        challenge = base64url_to_bytes(str(client_data["challenge"]))
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    table = security_key_challenge
    expected = (
        table.c.challenge_sha256 == token_hash(challenge.hex()),
        table.c.user_id == user_id,
        table.c.purpose == purpose,
        table.c.expires_at > now(),
    )
    # of two concurrent responses only one deletes the row
    return challenge if c.execute(delete(table).where(*expected)).rowcount else None


def register(
    c: Connection,
    site: Site,
    user_id: str,
    name: str,
    answer: Mapping[str, Any],
    challenge: bytes | None,
) -> Row[Any]:
    """Store a key from its response to a challenge of `take_challenge`, which must be committed first.

    Raises KeyRefused 403, Problem 409 for more than MOST_KEYS.
    """
    from webauthn import verify_registration_response

    if challenge is None or not site.has_keys or not second_factor.is_on(c, user_id):
        raise KeyRefused(403)
    with _refusals(403):
        verified = verify_registration_response(
            credential=dict(answer),
            expected_challenge=challenge,
            expected_rp_id=site.host,
            expected_origin=site.origin,
        )
    same = select(security_key.c.id).where(security_key.c.credential_id == verified.credential_id)
    if c.execute(same).first() is not None:
        raise KeyRefused(403)
    if len(list_keys(c, user_id)) >= MOST_KEYS:
        raise Problem(
            409,
            "too_many_keys",
            Message("An account has at most {MOST_KEYS} keys. Remove one first.", MOST_KEYS=MOST_KEYS),
        )
    row = {
        "id": new_id(),
        "user_id": user_id,
        "name": name,
        "host": site.address,
        "credential_id": verified.credential_id,
        "public_key": verified.credential_public_key,
        "sign_count": verified.sign_count,
        "created_at": now(),
    }
    c.execute(insert(security_key).values(row))
    return c.execute(select(security_key).where(security_key.c.id == row["id"])).one()


def begin_sign_in(c: Connection, site: Site, user_id: str) -> dict[str, Any] | None:
    """Options for signing in with a key; None if the account has no key for this address."""
    from webauthn import generate_authentication_options, options_to_json
    from webauthn.helpers.structs import PublicKeyCredentialDescriptor, UserVerificationRequirement

    keys = list_usable(c, site, user_id)
    if not keys or not second_factor.is_on(c, user_id):
        return None
    options = generate_authentication_options(
        rp_id=site.host,
        challenge=_new_challenge(c, user_id, "sign_in"),
        allow_credentials=[PublicKeyCredentialDescriptor(k.credential_id) for k in keys],
        # the password is the knowledge factor; the key is the possession factor
        user_verification=UserVerificationRequirement.DISCOURAGED,
    )
    return _as_tree(options_to_json(options))


def use(c: Connection, site: Site, user_id: str, answer: Mapping[str, Any]) -> bool:
    """Verify the response of a security key, once (writes)."""
    from webauthn import base64url_to_bytes, verify_authentication_response

    challenge = take_challenge(c, user_id, "sign_in", answer)
    if challenge is None:
        return False
    try:
        with _refusals(401):
            credential_id = base64url_to_bytes(str(answer.get("rawId", "")))
            mine = (security_key.c.user_id == user_id, security_key.c.credential_id == credential_id)
            key = c.execute(select(security_key).where(*mine)).one_or_none()
            if key is None or key.host != site.address:
                return False
            proof = verify_authentication_response(
                credential=dict(answer),
                expected_challenge=challenge,
                expected_rp_id=site.host,
                expected_origin=site.origin,
                credential_public_key=key.public_key,
                credential_current_sign_count=key.sign_count,
            )
    except KeyRefused:
        return False
    c.execute(
        update(security_key)
        .where(security_key.c.id == key.id)
        .values(sign_count=proof.new_sign_count, used_at=now())
    )
    return True


def remove(c: Connection, site: Site, user_id: str, key_id: str) -> None:
    """Delete one key of an account; if none is left here, codes are accepted again. Raises Problem 404."""
    mine = (security_key.c.id == key_id, security_key.c.user_id == user_id)
    if not c.execute(delete(security_key).where(*mine)).rowcount:
        raise Problem(404, "key_not_found", "No such key; it may already have been removed.")
    if not list_usable(c, site, user_id):
        second_factor.take_keys_only(c, user_id, only=False)


def _new_challenge(c: Connection, user_id: str, purpose: Purpose) -> bytes:
    """Create a challenge and delete expired or surplus ones of this account."""
    time, challenge = now(), secrets.token_bytes(32)
    table = security_key_challenge
    c.execute(delete(table).where(table.c.expires_at <= time))
    mine = select(table.c.challenge_sha256).where(table.c.user_id == user_id)
    waiting = c.execute(mine.order_by(table.c.expires_at.desc()).offset(_MOST_WAITING - 1)).scalars().all()
    c.execute(delete(table).where(table.c.challenge_sha256.in_(waiting)))
    row = {"challenge_sha256": token_hash(challenge.hex()), "user_id": user_id, "purpose": purpose}
    c.execute(insert(table).values(**row, expires_at=time + CHALLENGE_LIFE))
    return challenge


@contextlib.contextmanager
def _refusals(status: int) -> Iterator[None]:
    """Convert any error of the library into a refusal, since responses are untrusted input."""
    try:
        yield
    except Problem:
        raise
    except Exception as error:
        log.info("a security key was refused: %s", type(error).__name__)
        raise KeyRefused(status) from error


def _as_tree(text: str) -> dict[str, Any]:
    tree: dict[str, Any] = json.loads(text)
    return tree
