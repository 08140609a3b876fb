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
        "Anterior axis identified",
        "",
        False,
        "The facing direction of the sensor is unknown, so its angles are not reported.",
        "Stand still for 3 s, then walk at least 8 steps straight ahead, or declare the placement.",
    ),
    CheckRule(
        "stillness",
        "Standing still",
        "°",
        False,
        "The segment tilted during quiet standing, so its vertical is off by up to half of that.",
        "Ask the person to stand still for 3 to 5 s, holding a rail if needed, and record again.",
    ),
    CheckRule(
        "gravity",
        "Gravity at rest",
        "%",
        False,
        "The accelerometer deviates by this much at rest; distances and inclinations of this sensor are "
        "unreliable.",
        "Calibrate the accelerometer as the manufacturer describes, or use another sensor.",
    ),
    CheckRule(
        "axis_share",
        "Single axis of rotation",
        "",
        True,
        "The segment rotated about several axes, so its flexion axis is not clear.",
        "Fasten the sensor, and walk straight ahead at the usual speed, without turning.",
    ),
    CheckRule(
        "repetitions",
        "Steps or repetitions",
        "",
        True,
        "The direction is based on few repetitions, so it is strongly affected by chance.",
        "Walk further straight ahead, at least 8 steps, or repeat the movement at least 10 times.",
    ),
    CheckRule(
        "mirror",
        "Left–right symmetry of axes",
        "°",
        False,
        "The left and right axes of rotation are not mirror images; one anterior axis may be off by this "
        "much.",
        "Check that both sensors are firmly attached in the same position, then stand and walk again.",
    ),
    CheckRule(
        "knee_axis",
        "Knee axis from thigh and shank",
        "°",
        False,
        "Thigh and shank disagree on the knee axis, so one anterior axis is off by this much.",
        "Fasten both sensors at that knee away from muscle bellies, then stand and walk again.",
    ),
    CheckRule(
        "joint_misfit",
        "Joint consistency",
        "",
        False,
        "Adjacent sensors give different accelerations of the joint.",
        "Check the sensor assignment, the straps and the clocks, then record again.",
    ),
    CheckRule(
        "heading_spread",
        "Agreement on forward direction",
        "°",
        False,
        "Walking velocity, acceleration and joints give different forward directions.",
        "Start walking straight ahead from standing, walk without turning, and stand still at the end.",
    ),
)
"""All checks in the order in which they are shown."""

RULE_OF: Final[Mapping[CheckName, CheckRule]] = {rule.name: rule for rule in RULES}
