"""Reasons why a finished analysis has no avatar, which a repeated analysis would not change."""

from __future__ import annotations

from typing import Final

from sagittal.core.message import Message
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.words.wording import speak_places

FEW_SENSORS: Final = "this requires sensors on the pelvis and a leg, on the pelvis and feet, or on both feet."
OF_A_TEST: Final = "only times and values are measured in a test."
OF_DAYS: Final = "in daily life only activities and their times are measured."


def explain_no_figure(bundle: Bundle) -> str:
    """Reason in one sentence why an analysis has no poses: it stopped, its protocol, or its sensors."""
    stopped = next((n.message for n in bundle.warnings if n.severity == "error"), None)
    if stopped is not None:
        return Message(
            "No avatar for this trial: the analysis stopped before it. {stopped}",
            stopped=speak_places(stopped),
        )
    if bundle.functional is not None:
        return Message("No avatar for this trial: {OF_A_TEST}", OF_A_TEST=OF_A_TEST)
    if bundle.activity is not None:
        return Message("No avatar for this trial: {OF_DAYS}", OF_DAYS=OF_DAYS)
    return Message("No avatar for this trial: {FEW_SENSORS}", FEW_SENSORS=FEW_SENSORS)
