"""Tables of what opens an account besides its password, and of what a patient has agreed to.

By the rules of storage/tables.py.
"""

from __future__ import annotations

from sqlalchemy import CheckConstraint, Column, Date, Integer, LargeBinary, String, Table

from server.storage.columns import Json, Utc, id_column, metadata, one_of, owner, reference

CONSENT_PURPOSES = ("recording", "research", "teaching", "sharing")

consent = Table(
    "consent",
    metadata,
    id_column(),
    reference("patient_id", "patient"),
    Column("purpose", String(16), nullable=False),
    Column("given_on", Date, nullable=False),
    Column("evidence", String(200), nullable=False),  # where it is written: "signed form, file 12"
    Column("withdrawn_on", Date),
    Column("created_at", Utc, nullable=False),
    reference("created_by", "user", nullable=True, index=False),
    one_of("purpose", CONSENT_PURPOSES),
    CheckConstraint("withdrawn_on >= given_on", name="withdrawn"),
)

api_token = Table(
    "api_token",
    metadata,
    id_column(),
    reference("user_id", "user"),
    Column("name", String(40), nullable=False),
    Column("token_sha256", String(64), nullable=False, unique=True),  # the token itself was shown once
    Column("scopes", Json, nullable=False),
    Column("created_at", Utc, nullable=False),
    Column("expires_at", Utc, nullable=False),
    Column("used_at", Utc),
)

second_factor = Table(
    "second_factor",
    metadata,
    owner("user_id", "user"),
    Column("secret", LargeBinary, nullable=False),  # encrypted (server/auth/second_factor.py)
    Column("recovery", Json, nullable=False),  # hashes of the codes that have not been used
    Column("last_step", Integer, nullable=False),  # of the newest code that was taken: none is taken twice
    Column("confirmed_at", Utc),  # None: set up, and not yet proved by a code
)
