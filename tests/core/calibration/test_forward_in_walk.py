"""Parts of the anterior axis without standing; walks are tested in test_from_walking."""

from __future__ import annotations

import numpy as np

from sagittal.core.calibration.forward_in_walk import _in_order, _push, mask_of


def test_sensors_that_tell_their_sign_by_themselves_come_first() -> None:
    fromkeys = dict.fromkeys(("pelvis", "thigh_l", "foot_r", "shank_l"))
    assert list(_in_order(fromkeys)) == ["shank_l", "foot_r", "thigh_l", "pelvis"]  # type: ignore[arg-type]


def test_samples_of_the_parts_are_marked() -> None:
    assert np.flatnonzero(mask_of(6, [(0, 2), (4, 5)])).tolist() == [0, 1, 4]


def test_a_turned_part_is_pushed_along_its_own_way() -> None:
    t_s = np.arange(400) / 100.0
    wave = np.sin(2.0 * np.pi * t_s) + 0j
    a = np.concatenate([wave, wave * np.exp(0.5j)])
    push = _push(a, 0.0, [(0, 400), (400, 800)], [0.0, 0.5], 100.0)
    np.testing.assert_allclose(push[:400], push[400:], atol=1e-12)
    assert np.ptp(push) > 1.0
