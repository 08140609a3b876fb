"""Healthy people rarely exceed the limits."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from sagittal.core.flags import judge_flags
from sagittal.core.frames import SIDES
from sagittal.core.parameters.result import CycleCurves
from sagittal.core.subject.standing_angles import NAMES
from tests.helpers.wbds import people

OFTEN = {"knee_hyperextension": 0.15}
"""Rule → share of healthy sides beyond it, where more than 5 % are: the limit is an unverified one."""


@pytest.mark.recorded
def test_one_healthy_side_in_twenty_at_most_passes_a_limit() -> None:
    beyond: Counter[str] = Counter()
    verdict: Counter[str] = Counter()
    for person in people():
        curves = CycleCurves(
            {v: {s: np.radians(np.tile(person[s][v], (4, 1))) for s in SIDES} for v in person["left"]},
            dict.fromkeys(SIDES, (0, 1, 2, 3)),
            {s: np.ones(4, np.bool_) for s in SIDES},
            {s: np.full(4, 62.0) for s in SIDES},
        )
        for f in judge_flags(curves, [], dict.fromkeys(NAMES, 0.0)):
            if f.exceeded is not None:
                verdict[f.name] += 1
                beyond[f.name] += f.exceeded
    shares = {name: beyond[name] / n for name, n in verdict.items()}
    assert {name for name, n in verdict.items() if n == 84} == {
        "stiff_knee", "low_knee_flexion_swing", "knee_hyperextension", "low_dorsiflexion_swing", "hip_hiking",
        "low_hip_extension", "hip_range_asymmetry", "knee_range_asymmetry", "ankle_range_asymmetry",
    }  # fmt: skip
    for name, share in shares.items():
        assert share <= OFTEN.get(name, 0.05), (name, share)
