"""Compiled angles equal the readable decomposition, for all sensor sets and block sizes."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.angles import SIGNS, cardan_zxy, list_leg_joints, pelvis_angles
from sagittal.core.angles.kernel import AngleKernel, subtract_zero
from sagittal.core.body.tree import PRESETS
from sagittal.core.frames import SIDES, SUFFIX, Bools, Floats
from sagittal.core.rotation import conjugate, multiply

SEGMENTS = PRESETS["lower_body7"]


def turned(n: int) -> tuple[Floats, Bools]:
    """Random orientations (n, 7, 4), a tenth of which are not known."""
    rng = np.random.default_rng(1)
    q = rng.normal(size=(n, len(SEGMENTS), 4))
    return q / np.linalg.norm(q, axis=2, keepdims=True), rng.random((n, len(SEGMENTS))) > 0.1


def test_compiled_angles_are_those_of_the_decomposition() -> None:
    q, known_rotation = turned(400)
    kernel = AngleKernel.between(SEGMENTS)
    zero = np.linspace(-1.0, 1.0, len(kernel.names))
    mapping = dict(zip(kernel.names, kernel.measure(q, known_rotation, zero).T, strict=True))
    column = {s: i for i, s in enumerate(SEGMENTS)}
    expected: dict[str, Floats] = {}
    place = known_rotation[:, column["pelvis"]]
    for name, value in zip(
        ("pelvis_tilt", "pelvis_obliquity"), pelvis_angles(q[:, column["pelvis"]]), strict=True
    ):
        expected[name] = np.where(place, value, np.nan)
    for side in SIDES:
        for joint, proximal, distal in list_leg_joints(side):
            i, j = column[proximal], column[distal]
            abc = cardan_zxy(multiply(conjugate(q[:, i]), q[:, j]))
            for (base, right, left), value in zip(SIGNS[joint], abc.T, strict=True):
                sign = right if side == "right" else left
                expected[f"{base}_{SUFFIX[side]}"] = np.where(
                    known_rotation[:, i] & known_rotation[:, j], sign * value, np.nan
                )
    assert tuple(expected) == kernel.names
    for name, offset in zip(kernel.names, zero, strict=True):
        off = subtract_zero(mapping[name] - expected[name], -offset)
        np.testing.assert_allclose(off[np.isfinite(off)], 0.0, atol=1e-12)
        assert np.array_equal(np.isnan(mapping[name]), np.isnan(expected[name]))


def test_any_division_into_blocks_gives_the_same_bits() -> None:
    q, known_rotation = turned(300)
    kernel = AngleKernel.between(SEGMENTS)
    whole = kernel.measure(q, known_rotation)
    for step in (1, 7, 100):
        parts = [kernel.measure(q[k : k + step], known_rotation[k : k + step]) for k in range(0, 300, step)]
        np.testing.assert_array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize("worn", [("pelvis", "foot_l", "foot_r"), ("shank_l", "foot_l"), ("foot_r",)])
def test_angles_are_those_between_worn_neighbours(worn: tuple[str, ...]) -> None:
    names = AngleKernel.between(worn).names  # type: ignore[arg-type]
    assert ("pelvis_tilt" in names) == ("pelvis" in worn)
    assert ("ankle_dorsiflexion_l" in names) == ("shank_l" in worn)
    assert not any(name.startswith(("hip", "knee")) for name in names)


def test_a_joint_that_lacks_a_sensor_is_taken_from_the_figure_with_both_ends() -> None:
    q, known_rotation = turned(50)
    segments = PRESETS["feet_pelvis3"]
    kernel = AngleKernel.between(segments, SEGMENTS)
    sensors = np.array([SEGMENTS.index(s) for s in segments])
    second = q[::-1]
    pair = np.concatenate((second[:, sensors], q), axis=1)
    measurement = kernel.measure(pair, np.concatenate((known_rotation[:, sensors], known_rotation), axis=1))
    single, figure = AngleKernel.between(("pelvis",)), AngleKernel.between(SEGMENTS)
    np.testing.assert_array_equal(measurement[:, :2], single.measure(second[:, :1], known_rotation[:, :1]))
    np.testing.assert_array_equal(measurement[:, 2:], figure.measure(q, known_rotation)[:, 2:])
    assert kernel.estimated == (False, False, *([True] * (len(kernel.names) - 2)))
