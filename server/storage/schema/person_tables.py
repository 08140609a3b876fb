"""Tables of second factors and tokens, patient identities, and consents.

For conventions see storage/tables.py.
"""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Date,
    Integer,
    LargeBinary,
    String,
    Table,
    false,
)

from sagittal.server.storage.schema.columns import (
    Json,
    UserString,
    Utc,
    id_column,
    metadata,
    one_of,
    owner,
    reference,
)

CONSENT_PURPOSES = ("recording", "research", "teaching", "sharing")

consent = Table(
    "consent",
    metadata,
    id_column(),
    reference("patient_id", "patient"),
    Column("purpose", String(16), nullable=False),
    Column("given_on", Date, nullable=False),
    Column("evidence", UserString(200), nullable=False),  # reference to the document: "signed form, file 12"
    Column("withdrawn_on", Date),
    Column("created_at", Utc, nullable=False),
    reference("created_by", "user", nullable=True, index=False),
    one_of("purpose", CONSENT_PURPOSES),
    CheckConstraint("withdrawn_on >= given_on", name="withdrawn"),
)

patient_identity = Table(
    "patient_identity",  # all values encrypted, bound to patient and field (storage/field_cipher.py)
    metadata,
    owner("patient_id", "patient"),
    Column("name", LargeBinary),
    Column("born_on", LargeBinary),
    Column("record_number", LargeBinary),
    Column("insurance_number", LargeBinary),
    Column("contact", LargeBinary),
    Column("changed_at", Utc, nullable=False),
)

identity_key = Table(
    "identity_key",  # the key that encrypts patient_identity; no row: none used yet
    metadata,
    Column("purpose", String(16), primary_key=True),
    Column("name", String(16), nullable=False),
    Column("since", Utc, nullable=False),
    one_of("purpose", ("seal",)),
)

api_token = Table(
    "api_token",
    metadata,
    id_column(),
    reference("user_id", "user"),
    Column("name", UserString(40), nullable=False),
    Column("token_sha256", String(64), nullable=False, unique=True),  # the token itself was shown only once
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
    Column("recovery", Json, nullable=False),  # hashes of unused codes
    # time step of the newest accepted code: none is accepted twice
    Column("last_step", Integer, nullable=False),
    Column("confirmed_at", Utc),  # None: not yet confirmed by a code
    Column("keys_only", Boolean, nullable=False, server_default=false()),  # its codes are not accepted
)

security_key = Table(
    "security_key",
    metadata,
    id_column(),
    reference("user_id", "user"),
    Column("name", UserString(40), nullable=False),
    Column("host", UserString(255), nullable=False),  # host name and port where the key was registered
    Column("credential_id", LargeBinary, nullable=False, unique=True),
    Column("public_key", LargeBinary, nullable=False),
    Column("sign_count", Integer().with_variant(BigInteger(), "postgresql"), nullable=False),
    Column("created_at", Utc, nullable=False),
    Column("used_at", Utc),
)

security_key_challenge = Table(
    "security_key_challenge",  # issued and not yet answered
    metadata,
    Column("challenge_sha256", String(64), primary_key=True),
    reference("user_id", "user"),
    Column("purpose", String(16), nullable=False),
    Column("expires_at", Utc, nullable=False),
    one_of("purpose", ("register", "sign_in")),
)
