"""The reason of no figure is the protocol or what stopped the analysis before it is the sensors."""

from __future__ import annotations

from typing import Any

from sagittal.core.errors import Notice
from sagittal.server.report.view.no_figure import FEW_SENSORS, OF_A_TEST, explain_no_figure
from tests.server.report.conftest import MakeBundle


def test_the_reason_is_what_stopped_it_then_the_test_then_the_sensors(make_bundle: MakeBundle) -> None:
    stopped = Notice("axis", "right shank: long axis 76° off the vertical.", severity="error")
    test: dict[str, Any] = {
        "segments": [],
        "start_s": None,
        "end_s": None,
        "sensor": "pelvis",
        "corrected": False,
    }
    message = explain_no_figure(make_bundle(warnings=(stopped,), functional=test))
    assert message.endswith("the analysis stopped before it. right shank: long axis 76° off the vertical.")
    assert explain_no_figure(make_bundle(functional=test)).endswith(OF_A_TEST)
    assert explain_no_figure(make_bundle()).endswith(FEW_SENSORS)
