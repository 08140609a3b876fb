"""Texts of the calibration checks: titles, interpretation of a failed check, and remedy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

CheckName = Literal[
    "forward_found", "stillness", "gravity", "axis_share", "repetitions", "mirror", "knee_axis",
    "joint_misfit", "heading_spread",
]  # fmt: skip


@dataclass(frozen=True)
class CheckRule:
    """One check as presented to users.

    Parameters
    ----------
    least : the value must reach the limit; otherwise it must not exceed it. means : interpretation of a
    failed check. todo : remedy.
    """

    name: CheckName
    title: str
    unit: str
    least: bool
    means: str
    todo: str


RULES: Final[tuple[CheckRule, ...]] = (
    CheckRule(
        "forward_found",
        "Forward axis found",
        "",
        False,
        "Which way the sensor faces is not known, so its angles are withheld.",
        "Stand still for 3 s, then walk at least 8 steps straight ahead, or declare the mounting.",
    ),
    CheckRule(
        "stillness",
        "Standing still",
        "°",
        False,
        "The segment tilted while the person stood, so its upright is off by up to half of that.",
        "Let the person stand still for 3 to 5 s, with a hand on a rail if needed, and record again.",
    ),
    CheckRule(
        "gravity",
        "Gravity at rest",
        "%",
        False,
        "The accelerometer is off by so much at rest; distances and tilts of this sensor are doubtful.",
        "Calibrate the accelerometer as its maker says, or wear another sensor.",
    ),
    CheckRule(
        "axis_share",
        "One axis of turning",
        "",
        True,
        "The segment turned about several axes, so its flexion axis is not clear.",
        "Fasten the sensor, and walk straight ahead at the usual speed, without turning.",
    ),
    CheckRule(
        "repetitions",
        "Steps or repetitions",
        "",
        True,
        "The direction rests on few repetitions, so chance has a large part in it.",
        "Walk further straight ahead, at least 8 steps, or repeat the movement at least 10 times.",
    ),
    CheckRule(
        "mirror",
        "Left mirrors right",
        "°",
        False,
        "Left and right turn about axes that are no mirror images; one forward axis may be off by that.",
        "Look whether both sensors sit alike and tight, then stand and walk again.",
    ),
    CheckRule(
        "knee_axis",
        "Knee seen from both sides",
        "°",
        False,
        "Thigh and shank disagree about the axis of their knee, so one forward axis is off by that.",
        "Fasten both sensors of that knee, away from muscle, then stand and walk again.",
    ),
    CheckRule(
        "joint_misfit",
        "Joints hold together",
        "",
        False,
        "The sensors beside its joints do not show one acceleration of the joint.",
        "Check who wears which sensor, its strap and its clock; then record again.",
    ),
    CheckRule(
        "heading_spread",
        "Measures of forward agree",
        "°",
        False,
        "Walking velocity, acceleration and joints show different ways forward.",
        "Start straight ahead from standing, walk without turning, and stand still at the end.",
    ),
)
"""All checks in the order in which they are shown."""

RULE_OF: Final[Mapping[CheckName, CheckRule]] = {rule.name: rule for rule in RULES}
