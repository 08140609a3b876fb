"""Prescription schemas: allowed fields and defaults."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import pytest
from pydantic import ValidationError

from sagittal.core.feedback import Prescription
from sagittal.server.api.results.feedback_schemas import Feedback, PrescriptionNew, TargetNew

WRITTEN = {"parameter": "stance_pct", "side": "left", "target": {"source": "manual", "mean": 62.0, "sd": 2.0}}


def test_what_is_left_out_is_what_the_core_has_by_itself() -> None:
    sent = PrescriptionNew.model_validate(WRITTEN).model_dump()
    usual = Prescription.from_json(WRITTEN)
    assert Prescription.from_json(sent) == usual
    assert set(sent) == set(asdict(usual))
    for part in ("target", "schedule", "progression", "stop_rule", "guard"):
        assert set(sent[part]) == set(asdict(getattr(usual, part))), part


@pytest.mark.parametrize(
    "changed",
    [
        {"parameter": "Stance"},
        {"parameter": ""},
        {"parameter": "x" * 65},
        {"side": "both"},
        {"band_sd": float("nan")},
        {"band_sd": float("inf")},
        {"modes": ["lamp"]},
        {"modes": ["bar"] * 9},
        {"schedule": {"kind": "sometimes"}},
        {"schedule": {"shares_pct": [100] * 21}},
        {"progression": {"worse": "higher"}},
        {"stop_rule": {"max_minutes": float("inf")}},
        {"colour": "red"},
    ],
)
def test_what_is_none_is_refused(changed: dict[str, Any]) -> None:
    PrescriptionNew.model_validate(WRITTEN)
    with pytest.raises(ValidationError):
        PrescriptionNew.model_validate(WRITTEN | changed)


def test_a_target_is_looked_up_unless_it_is_said() -> None:
    assert TargetNew().model_dump() == {
        "source": "norm",
        "mean": None,
        "sd": None,
        "words": "",
        "session_id": None,
    }
    with pytest.raises(ValidationError):
        TargetNew.model_validate({"session_id": "1"})
    with pytest.raises(ValidationError):
        TargetNew.model_validate({"source": "best_guess"})


def test_without_feedback_there_is_a_reason_and_nothing_shared() -> None:
    one, second = Feedback("no_take"), Feedback("no_take")
    one.rows.append({"n": 1})
    assert second.rows == []
    assert (second.reason, second.prescription, second.retention) == ("no_take", None, None)
