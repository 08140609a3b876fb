"""Values known before a trial survive JSON; invalid ones are refused."""

from __future__ import annotations

import json

import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.feedback.baseline import Baseline
from sagittal.core.feedback.prescription import LEVELS

KNOWN = Baseline(0.4, 0.03, 40, "before", 3, 0.07, "Kesar", after_training=True)


@pytest.mark.parametrize("baseline", [KNOWN, Baseline()])
def test_a_baseline_survives_json(baseline: Baseline) -> None:
    assert Baseline.from_json(json.loads(json.dumps(baseline.to_json()))) == baseline


def test_nothing_is_known_where_nothing_is_said() -> None:
    assert Baseline.from_json({}) == Baseline()
    assert Baseline().mean is None
    assert not Baseline().after_training


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("sd", -0.01), ("n", -1), ("n", 10**9 + 1), ("last_level", LEVELS + 1), ("last_level", -1),
        ("other_mdc", -1.0), ("after_training", None), ("session_id", 7), ("nonsense", 1),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(field: str, value: object) -> None:
    with pytest.raises(ParameterError, match=field) as refused:
        Baseline.from_json({**KNOWN.to_json(), field: value})
    assert refused.value.code == "bad_prescription"
    assert refused.value.message.startswith("baseline")


@pytest.mark.parametrize("level", [0, LEVELS])
def test_the_hardest_and_the_easiest_level_are_still_levels(level: int) -> None:
    assert Baseline.from_json({"last_level": level, "sd": 0.0}).last_level == level
