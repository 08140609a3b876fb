from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from sagittal.core.errors import Notice
from sagittal.core.parameters import gait_parameters
from sagittal.server.report.files.bundle import Bundle
from tests.server import walk

MakeBundle = Callable[..., Bundle]


@pytest.fixture(scope="session")
def make_bundle() -> MakeBundle:
    """Bundles of a finished synthetic walk of a given length."""

    def make(duration_s: float = 12.0, warnings: tuple[Notice, ...] = (), **changes: Any) -> Bundle:
        angles, strides = walk.angles(duration_s), walk.strides(duration_s)
        parts: dict[str, Any] = {
            "quality": {
                "level": "good",
                "duration_s": duration_s,
                "sensors": [{"segment": "shank_r", "lost_pct": 0.31, "magnetic_pct": 12.0}],
                "rest_s": [[0.0, 3.0]],
            },
            "calibration": {
                "method": "walking_direction",
                "segments": {"pelvis": {"score": 0.92}, "foot_l": {"score": 0.97}},
                "angle_zero": "standing",
            },
            "parameters": gait_parameters(strides, angles),
            "warnings": warnings,
            "provenance": {},
            "angles": angles,
            "events": walk.events(duration_s),
            "strides": strides,
        }
        return Bundle(**{**parts, **changes})

    return make


@pytest.fixture(scope="session")
def bundle(make_bundle: MakeBundle) -> Bundle:
    return make_bundle()
