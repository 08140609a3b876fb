"""Wrong units and signs at their reporting limits, and severity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.quality.signals import Facts
from sagittal.core.quality.suspicion import list_suspicions
from sagittal.core.rotation import about

STANDS = Facts(True, GRAVITY, 0.02, slice(0, 100), GRAVITY, 2.0, 5.0)
"""Somebody who stood, then walked."""

WALKS = replace(STANDS, still=False, still_norm=2.0, still_gyro=None)
"""Somebody who never stood."""

ACC = np.tile([0.0, 0.0, GRAVITY], (20, 1))


def told(facts: Facts, acc: Floats = ACC, quat: Floats | None = None) -> list[tuple[str, str]]:
    suspicions = list_suspicions("A7", facts, acc, quat)
    assert all(n.sensor == "A7" and "A7" in n.message for n in suspicions)
    return [(n.code, n.severity) for n in suspicions]


UNIT, WARNED = ("unit_suspect", "error"), ("unit_suspect", "warning")
REMOVED = ("gravity_removed", "error")


@pytest.mark.parametrize(
    ("norm", "expected", "words"),
    [
        (1.099 * GRAVITY, [], ""),
        (0.901 * GRAVITY, [], ""),
        (1.101 * GRAVITY, [WARNED], "check its calibration"),
        (0.899 * GRAVITY, [WARNED], "check its calibration"),
        (1.249 * GRAVITY, [WARNED], "check its calibration"),
        (1.251 * GRAVITY, [UNIT], "check its calibration"),
        (0.749 * GRAVITY, [UNIT], "check its calibration"),
        (1.099, [UNIT], "it is in g"),
        (0.901, [UNIT], "it is in g"),
        (0.899, [UNIT], "check its calibration"),
        (0.501, [UNIT], "check its calibration"),
        (0.499, [REMOVED], "at rest"),
    ],
)
def test_the_force_at_rest_is_gravity(norm: float, expected: list[tuple[str, str]], words: str) -> None:
    facts = replace(STANDS, still_norm=norm)
    assert told(facts) == expected
    assert all(words in n.message for n in list_suspicions("A7", facts, ACC, None))


@pytest.mark.parametrize(
    ("median", "still_norm", "acc_std", "expected", "words"),
    [
        (0.501 * GRAVITY, 2.0, 2.0, [], ""),
        (1.999 * GRAVITY, 2.0, 2.0, [], ""),
        (2.001 * GRAVITY, 2.0, 2.0, [UNIT], "is around 19.6 m/s²"),
        (0.499 * GRAVITY, 2.0, 2.0, [REMOVED], "mid-trial"),
        (1.0, 0.9, 0.3, [UNIT], "looks like g"),
        (0.71, 0.9, 0.3, [UNIT], "looks like g"),
        (1.49, 0.9, 0.3, [UNIT], "looks like g"),
        # what is left without gravity may happen to be of that size
        (0.69, 0.9, 0.3, [REMOVED], "mid-trial"),
        (1.51, 0.9, 0.3, [REMOVED], "mid-trial"),
        (1.0, 0.4, 0.3, [REMOVED], "mid-trial"),
        (1.0, 0.9, 1.6, [REMOVED], "mid-trial"),
    ],
)
def test_without_rest_the_middle_of_the_take_is_near_gravity(
    median: float, still_norm: float, acc_std: float, expected: list[tuple[str, str]], words: str
) -> None:
    facts = replace(WALKS, median_norm=median, still_norm=still_norm, acc_std=acc_std)
    assert told(facts) == expected
    assert all(words in n.message for n in list_suspicions("A7", facts, ACC, None))


@pytest.mark.parametrize(
    ("facts", "words"),
    [
        (replace(STANDS, gyro_top=None), None),
        (replace(STANDS, gyro_top=39.9), None),
        (replace(STANDS, gyro_top=40.1), "reaches 40 rad/s"),
        (replace(STANDS, still_gyro=0.19), None),
        (replace(STANDS, still_gyro=0.21, acc_std=0.9), "0.21 rad/s while the acceleration is still"),
        # who walks in degrees read as radians exceeds every range: up to 20 deg/s are an offset
        (replace(STANDS, still_gyro=0.34), None),
        (replace(STANDS, still_gyro=0.36), "0.36 rad/s while the acceleration is still"),
        (replace(STANDS, still_gyro=None), None),
        (replace(WALKS, still_gyro=5.0), None),
        (replace(STANDS, gyro_top=np.radians(10.1)), None),
        (replace(STANDS, gyro_top=np.radians(9.9)), "never exceeds 9.9 deg/s"),
        # of a sensor that lies still no more can be asked
        (replace(STANDS, gyro_top=np.radians(9.9), acc_std=0.9), None),
    ],
)
def test_a_rate_beyond_any_sensor_at_rest_or_in_motion_is_the_wrong_unit(
    facts: Facts, words: str | None
) -> None:
    suspicions = list_suspicions("A7", facts, ACC, None)
    assert [(n.code, n.severity) for n in suspicions] == ([] if words is None else [UNIT])
    assert all(words is not None and words in n.message for n in suspicions)


@pytest.mark.parametrize(("degrees", "told_of"), [(0.0, False), (119.0, False), (121.0, True), (180.0, True)])
def test_with_an_orientation_the_force_points_up(degrees: float, told_of: bool) -> None:
    quat = np.tile(3.0 * about(0, np.radians(degrees)), (len(ACC), 1))
    assert told(STANDS, quat=quat) == ([("gravity_sign", "error")] if told_of else [])


def test_a_few_samples_say_nothing_of_the_sign() -> None:
    quat = np.tile(about(0, np.pi), (len(ACC), 1))
    quat[9:] = np.nan
    assert told(STANDS, quat=quat) == []
    quat[9] = quat[0]
    assert told(STANDS, quat=quat) == [("gravity_sign", "error")]
