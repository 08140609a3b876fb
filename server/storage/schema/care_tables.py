"""Tables of care teams and emergency access; for conventions see storage/tables.py."""

from __future__ import annotations

from sqlalchemy import CheckConstraint, Column, String, Table

from sagittal.server.storage.schema.columns import UserLines, Utc, id_column, metadata, owner, reference

clinic_option = Table(
    "clinic_option",  # options enabled by the clinic; an option without a row is off
    metadata,
    Column("name", String(32), primary_key=True),
    Column("since", Utc, nullable=False),
)

care_team_member = Table(
    "care_team_member",
    metadata,
    owner("patient_id", "patient"),
    owner("user_id", "user"),
    Column("since", Utc, nullable=False),
)

emergency_access = Table(
    "emergency_access",  # temporary access for a user outside the team, with a reason
    metadata,
    id_column(),
    reference("patient_id", "patient"),
    reference("user_id", "user"),
    Column("reason", UserLines, nullable=False),
    Column("opened_at", Utc, nullable=False),
    Column("ends_at", Utc, nullable=False),
    Column("ended_at", Utc),  # ended early by a user: permanent, independent of the clock
    CheckConstraint("ends_at > opened_at", name="ends"),
)
