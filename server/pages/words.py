"""What pages call protocols, segments, roles and states."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Final

from server.auth.roles import Role

PROTOCOLS: Final = (
    ("walk", "Walk", "Over ground, there and back, with a few seconds of quiet standing before or after."),
    ("treadmill", "Treadmill", "Walking on the belt, with a few seconds of quiet standing before or after."),
)

PROTOCOL_NAMES: Final = {value: name for value, name, _ in PROTOCOLS}

ROLE_WORDS: Final[Mapping[Role, str]] = {
    Role.ADMIN: "Everything, users and the audit log included.",
    Role.CLINICIAN: "Patients, uploads, analyses and results.",
    Role.ASSISTANT: "Adds sessions and uploads recordings; sees what was found in them, not the results.",
    Role.VIEWER: "Reads patients and results, changes nothing.",
}

SEGMENT_NAMES: Final = {
    "pelvis": "Pelvis",
    "thigh_l": "Left thigh",
    "thigh_r": "Right thigh",
    "shank_l": "Left shank",
    "shank_r": "Right shank",
    "foot_l": "Left foot",
    "foot_r": "Right foot",
    "chest": "Chest",
}


def describe_person(sex: str | None, birth_year: int | None) -> str:
    """Sex and age as in "M, 58 y"."""
    parts = [sex[0].upper()] if sex else []
    if birth_year:
        parts.append(f"{dt.datetime.now(dt.UTC).year - birth_year} y")
    return ", ".join(parts)
