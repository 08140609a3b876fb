"""Walking condition of a recording: pace, feedback, walking aid, orthosis, footwear, overground or treadmill.

A difference between two recordings is a change of the person only if the conditions were equal.
`is_comparable` implements that rule for every table, trend and baseline. An unstated item is None: it is
comparable only to another unstated one, and the wording shows it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from sagittal.core.frames import Protocol
from sagittal.core.message import Message

WalkingPace = Literal["comfortable", "slow", "fast"]
WalkingAid = Literal[
    "none", "stick", "four_point_stick", "crutch", "crutches", "frame", "rollator", "handrail", "person",
    "harness",
]  # fmt: skip
Orthosis = Literal["none", "insole", "foot_lifter", "ankle_foot", "knee", "knee_ankle_foot", "stimulation"]
Footwear = Literal["shoes", "orthopaedic_shoes", "socks", "barefoot"]

CHOICES: Final[Mapping[str, Mapping[str, str]]] = {
    "pace": {"comfortable": "comfortable pace", "slow": "slow", "fast": "fast"},
    "aid": {
        "none": "no aid",
        "stick": "stick",
        "four_point_stick": "quad stick",
        "crutch": "one crutch",
        "crutches": "two crutches",
        "frame": "walking frame",
        "rollator": "rollator",
        "handrail": "handrail or bars",
        "person": "hand-held assistance",
        "harness": "body-weight support",
    },
    "orthosis": {
        "none": "no orthosis",
        "insole": "insoles",
        "foot_lifter": "foot-drop splint",
        "ankle_foot": "ankle-foot orthosis",
        "knee": "knee orthosis",
        "knee_ankle_foot": "knee-ankle-foot orthosis",
        "stimulation": "electrical stimulation",
    },
    "shoes": {
        "shoes": "shoes",
        "orthopaedic_shoes": "orthopaedic shoes",
        "socks": "socks",
        "barefoot": "barefoot",
    },
}
"""What a person states → its values in words."""

PROTOCOL_WORDS: Final[Mapping[Protocol, str]] = {
    "walk": "over ground",
    "treadmill": "treadmill",
    "squat": "squats",
    "tug": "timed up and go",
    "five_sit_to_stand": "five times sit to stand",
    "walk_10m": "ten metres",
    "walk_6min": "six minutes",
    "standing_eyes_open": "standing, eyes open",
    "standing_eyes_closed": "standing, eyes closed",
    "activity": "daily activity",
}

SAME_BELT_MPS: Final = 0.02
"""Entered speeds of a belt that differ by less are one speed: the smallest step of a treadmill, 0.1 km/h, is
0.028 m/s."""

NOT_STATED: Final = "condition not stated"


@dataclass(frozen=True)
class WalkingCondition:
    """The walking condition of a recording.

    Parameters
    ----------
    pace, aid, orthosis, shoes : of CHOICES; None = not stated.
    feedback : biofeedback was given while walking.
    protocol : walking protocol. belt_speed_mps : treadmill speed, None = not entered.
    """

    pace: WalkingPace | None = None
    aid: WalkingAid | None = None
    orthosis: Orthosis | None = None
    shoes: Footwear | None = None
    feedback: bool = False
    protocol: Protocol = "walk"
    belt_speed_mps: float | None = None

    @property
    def stated(self) -> dict[str, Any]:
        """The items to be stated by the user, by the names of CHOICES."""
        return {name: getattr(self, name) for name in CHOICES}

    @property
    def unstated(self) -> tuple[str, ...]:
        """Names of the items that were not stated."""
        names = tuple(name for name, value in self.stated.items() if value is None)
        belt = self.protocol == "treadmill" and self.belt_speed_mps is None
        return (*names, "belt speed") if belt else names

    @property
    def is_at_own_pace(self) -> bool:
        """Whether the person walked at a self-selected pace, or the pace is unstated."""
        return self.pace in {None, "comfortable"}

    @property
    def is_unaided(self) -> bool:
        """Whether no feedback, aid or orthosis is stated, which makes the recording usable as a reference."""
        return not self.feedback and self.aid in {None, "none"} and self.orthosis in {None, "none"}

    @property
    def words(self) -> str:
        """Description in words, "own pace, no aid, shoes"; an orthosis is mentioned only if used."""
        floor = [] if self.protocol == "walk" else [self._floor]
        feedback_words = ["with feedback"] if self.feedback else []
        choices = {name: CHOICES[name].get(value or "") for name, value in self.stated.items()}
        if not any(choices.values()):
            return ", ".join([*floor, NOT_STATED, *feedback_words])
        if self.orthosis == "none":
            del choices["orthosis"]
        return ", ".join(
            [*floor, *(text or f"{name} not stated" for name, text in choices.items()), *feedback_words]
        )

    @property
    def _floor(self) -> str:
        belt = (
            ""
            if self.belt_speed_mps is None
            else Message(" at {belt_speed_mps:.2f}\u202fm/s", belt_speed_mps=self.belt_speed_mps)
        )
        return PROTOCOL_WORDS[self.protocol] + belt


USUAL: Final = WalkingCondition("comfortable", "none", "none", "shoes")
"""What a form is filled with before anybody says otherwise."""


def is_alike(a: WalkingCondition, b: WalkingCondition) -> bool:
    """Whether two recordings have the same condition, apart from feedback."""
    # most are equal, and a list asks thousands of times
    return a == b or not compare_conditions(replace(a, feedback=False), replace(b, feedback=False))


def is_comparable(a: WalkingCondition, b: WalkingCondition) -> bool:
    """Whether a difference between two recordings is a change: equal conditions, neither with feedback."""
    return not a.feedback and not b.feedback and is_alike(a, b)


def compare_conditions(a: WalkingCondition, b: WalkingCondition) -> tuple[str, ...]:
    """Differences between the conditions of one recording and a later one, in words: "own pace, then
    fast".
    """
    differences: list[str] = []
    if a.protocol != b.protocol:
        differences.append(
            Message(
                "{protocol}, then {protocol2}",
                protocol=PROTOCOL_WORDS[a.protocol],
                protocol2=PROTOCOL_WORDS[b.protocol],
            )
        )
    elif not _same_belt(a.belt_speed_mps, b.belt_speed_mps):
        speeds = [
            "unknown" if c.belt_speed_mps is None else f"{c.belt_speed_mps:.2f}\u202fm/s" for c in (a, b)
        ]
        differences.append(
            Message("belt speed {speeds}, then {speeds2}", speeds=speeds[0], speeds2=speeds[1])
        )
    for name, words in CHOICES.items():
        values = [getattr(c, name) for c in (a, b)]
        if values[0] != values[1]:
            first, second = (words.get(v or "", Message("{name} not stated", name=name)) for v in values)
            differences.append(Message("{first}, then {second}", first=first, second=second))
    if a.feedback != b.feedback:
        differences.append("with feedback, then without" if a.feedback else "without feedback, then with")
    return tuple(differences)


def _same_belt(a: float | None, b: float | None) -> bool:
    return abs(a - b) < SAME_BELT_MPS if a is not None and b is not None else a is b
