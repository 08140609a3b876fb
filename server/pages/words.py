"""Display names of protocols, segments, roles and states."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Final

from sagittal.server.auth.roles import Role

PROTOCOLS: Final = (
    ("walk", "Walk", "Over ground, there and back, with a few seconds of quiet standing before or after."),
    ("treadmill", "Treadmill", "Walking on the belt, with a few seconds of quiet standing before or after."),
    (
        "squat",
        "Squats",
        "Stand still for 2 s, then squat on one leg, each in turn, or both. Sensors: back, shin, thigh.",
    ),
    ("activity", "Daily life", "Hours to days at home with one sensor on the chest or the lower back."),
)

CALIBRATIONS: Final = (
    (
        "walk",
        "Stand and walk",
        "Stand still for 3 to 5 s with both feet side by side. Then walk straight ahead, at least 8 steps.",
    ),
    (
        "swing",
        "Stand and swing each leg",
        (
            "Stand still and hold a rail. Swing each leg from the hip at least 10 times, further forward "
            "than back."
        ),
    ),
    (
        "bow",
        "Stand and bow",
        "For the pelvis: stand still, then bow from the hips at least 5 times. Keep both feet still.",
    ),
    (
        "table",
        "From the table",
        (
            "For squats: place the sensors on the table, arrows forward, and keep them still. Attach all of "
            "them within a minute, then stand still."
        ),
    ),
    (
        "declared",
        "Declared placement",
        "No movement needed: the manifest declares the placement of each sensor. Stand still for 3 s.",
    ),
    (
        "take",
        "From the trial itself",
        (
            "For people who cannot stand still: the walk itself is used for calibration; angles then have no "
            "absolute level."
        ),
    ),
)
"""Calibration methods: name of the drawing, title, instruction. The analysis detects which was used."""

TEST_PROTOCOLS: Final = (
    (
        "tug",
        "Timed up and go",
        "Sit quietly, stand up, walk 3 m, turn, walk back, sit down. Sensor on pelvis or chest.",
    ),
    (
        "five_sit_to_stand",
        "Five times sit to stand",
        "Sit quietly, stand up and sit down five times with arms folded. Sensor on pelvis or chest.",
    ),
    (
        "walk_10m",
        "Ten-metre walk",
        "Quiet standing, 14 m straight ahead, quiet standing. Sensors on both feet.",
    ),
    (
        "walk_6min",
        "Six-minute walk",
        "Quiet standing, then walk back and forth for six minutes. Sensors on both feet.",
    ),
    (
        "standing_eyes_open",
        "Standing, eyes open",
        "Stand quietly for 30 s or more. Sensor on pelvis or chest.",
    ),
    (
        "standing_eyes_closed",
        "Standing, eyes closed",
        "The same with eyes closed, with someone standing next to the person.",
    ),
)
"""Functional tests."""

TEST_NAMES: Final = frozenset(value for value, _, _ in TEST_PROTOCOLS)

PROTOCOL_NAMES: Final = {value: name for value, name, _ in (*PROTOCOLS, *TEST_PROTOCOLS)}

ROLE_WORDS: Final[Mapping[Role, str]] = {
    Role.ADMIN: "Full access, including users and the audit log.",
    Role.CLINICIAN: "Patients, uploads, analyses and results.",
    Role.ASSISTANT: "Adds visits and uploads recordings; sees the recording check but not the results.",
    Role.VIEWER: "Views patients and results; cannot change anything.",
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
    """Sex and age, for example "M, 58 y"."""
    parts = [sex[0].upper()] if sex else []
    if birth_year:
        parts.append(f"{dt.datetime.now(dt.UTC).year - birth_year} y")
    return ", ".join(parts)
