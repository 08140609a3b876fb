"""Fourier series of gait cycles, and known properties of the curves."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.simulate.gait.curves import (
    ANKLE_DORSIFLEXION,
    FOOT_PITCH,
    HIP_ADDUCTION,
    HIP_FLEXION,
    KNEE_FLEXION,
    PELVIS_OBLIQUITY,
    PELVIS_ROTATION,
    PELVIS_TILT,
    Curve,
)

PHASE = np.arange(400) / 400.0


def test_the_coefficients_are_those_of_cosines_and_sines_in_degrees() -> None:
    curve = Curve((3.0, 5.0, -2.0, 0.5, 4.0))
    turn = 2.0 * np.pi * PHASE
    expected = 3.0 + 5.0 * np.cos(turn) - 2.0 * np.sin(turn) + 0.5 * np.cos(2 * turn) + 4.0 * np.sin(2 * turn)
    assert np.degrees(curve(PHASE)) == pytest.approx(expected, abs=1e-12)
    assert curve(PHASE + 3.0) == pytest.approx(curve(PHASE), abs=1e-12)
    assert np.degrees(curve.mean) == pytest.approx(3.0)
    assert curve(np.array(0.25)) == pytest.approx(np.radians(3.0 - 2.0 - 0.5))
    assert np.degrees(Curve((7.0,))(PHASE)) == pytest.approx(7.0)


@pytest.mark.parametrize(
    ("curve", "sign"), [(PELVIS_TILT, 1.0), (PELVIS_OBLIQUITY, -1.0), (PELVIS_ROTATION, -1.0)]
)
def test_half_a_stride_on_the_pelvis_does_the_same_for_the_other_side(curve: Curve, sign: float) -> None:
    assert np.degrees(curve(PHASE + 0.5)) == pytest.approx(sign * np.degrees(curve(PHASE)), abs=0.01)


@pytest.mark.parametrize(
    ("curve", "peak_pct", "low_pct"),
    [
        # healthy adults: the knee straightens in mid-stance, the hip extends before foot-off,
        # the ankle is most plantarflexed at foot-off, the toes are highest at contact
        (KNEE_FLEXION, (68, 76), (34, 44)),
        (HIP_FLEXION, (82, 96), (48, 56)),
        (ANKLE_DORSIFLEXION, (40, 52), (58, 68)),
        (HIP_ADDUCTION, (12, 30), (55, 68)),
        (FOOT_PITCH, (90, 100), (56, 66)),
    ],
)
def test_extremes_lie_where_healthy_adults_have_them(
    curve: Curve, peak_pct: tuple[int, int], low_pct: tuple[int, int]
) -> None:
    values = curve(PHASE)
    assert peak_pct[0] <= 100.0 * PHASE[int(np.argmax(values))] <= peak_pct[1]
    assert low_pct[0] <= 100.0 * PHASE[int(np.argmin(values))] <= low_pct[1]


def test_the_foot_is_flat_in_mid_stance_and_its_toes_are_up_at_contact() -> None:
    pitch = np.degrees(FOOT_PITCH(np.array([0.0, 0.2, 0.3])))
    assert 10.0 < pitch[0] < 20.0
    assert np.abs(pitch[1:]).max() < 2.0
