"""Instructions for the subject of a guided functional test, on all screens."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from sagittal.core.message import Message

TOTAL: Final[Mapping[str, str]] = {
    "tug": "tug_duration_s",
    "five_sit_to_stand": "five_sit_to_stand_s",
    "walk_10m": "walk_10m_speed_mps",
    "walk_6min": "walk_6min_distance_m",
    "standing_eyes_open": "sway_rms_mps2",
    "standing_eyes_closed": "sway_rms_mps2",
}
"""Guided protocol → main parameter."""

_UPRIGHT: Final = "The test has started. Keep standing still."

SAYS: Final[Mapping[str, Mapping[str, str]]] = {
    "tug": {
        "get_ready": "Sit back against the chair and keep still.",
        "ready": "On “Go”: stand up, walk three metres, turn, walk back, sit down.",
        "running": "Walk three metres, turn, walk back, sit down.",
    },
    "five_sit_to_stand": {
        "get_ready": "Sit back against the chair, arms folded, and keep still.",
        "ready": "On “Go”: stand up and sit down five times, as fast as you safely can.",
        "running": "Stand up fully, sit down fully, five times.",
    },
    "walk_10m": {
        "get_ready": "Stand still at the start, both feet side by side.",
        "ready": "On “Go”: walk straight ahead at your usual pace to the far mark.",
        "running": "Walk to the far mark, then stand still.",
    },
    "walk_6min": {
        "get_ready": "Stand still at the start, both feet side by side.",
        "ready": "On “Go”: walk back and forth for six minutes, as far as you can. You may rest.",
        "running": "Keep walking as far as you can. You may slow down or rest.",
    },
    "standing_eyes_open": {
        "get_ready": "Stand still, arms at your sides, and look straight ahead.",
        "ready": "Stand still.",
        "running": Message("{UPRIGHT} Eyes open.", UPRIGHT=_UPRIGHT),
    },
    "standing_eyes_closed": {
        "get_ready": "Stand still, arms at your sides. Someone is next to you. Close your eyes.",
        "ready": "Stand still.",
        "running": Message("{UPRIGHT} Eyes closed.", UPRIGHT=_UPRIGHT),
    },
}
"""Instruction to the subject: protocol → phase → words."""

HINTS: Final[Mapping[str, str]] = {
    "tug": "The clock starts with the first lean forward and stops when the person sits again.",
    "five_sit_to_stand": "The clock starts with the first lean and stops after the fifth sitting down.",
    "walk_10m": "Walk 14 m. The clock starts with the first step; two seconds of standing end the test.",
    "walk_6min": "The clock starts with the first step and stops after six minutes.",
    "standing_eyes_open": (
        "Press Go. The clock starts after two seconds of quiet standing and stops after 30 s."
    ),
    "standing_eyes_closed": (
        "Press Go. The clock starts after two seconds of quiet standing and stops after 30 s."
    ),
}
"""Start and end of a test."""

OVER: Final = "The test is over. You may rest."


def tell_person(protocol: str, phase: str) -> str:
    """Current instruction, by protocol and phase (core/functional_tests/guided.py)."""
    return SAYS[protocol].get(phase, OVER)
