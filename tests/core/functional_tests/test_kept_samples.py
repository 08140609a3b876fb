"""The last samples are retained unchanged, whatever was discarded and however the buffer grew."""

from __future__ import annotations

import numpy as np

from sagittal.core.functional_tests.kept_samples import KeptSamples
from sagittal.core.timeline.live import UniformBlock

BLOCK = 250
BLOCKS = 20


def block(first: int) -> UniformBlock:
    indices = np.arange(first, first + BLOCK)
    acc = np.repeat(indices[:, None, None], 6, axis=1).reshape(BLOCK, 2, 3).astype(float)
    even = np.stack((indices % 2 == 0, indices % 3 == 0), axis=1)
    return UniformBlock(first, indices / 100.0, acc, -acc, even, ~even)


def test_samples_are_cut_at_their_places_after_the_room_grew_and_older_ones_were_forgotten() -> None:
    retained = KeptSamples(1)
    for k in range(BLOCKS):
        retained.append(block(k * BLOCK), np.array([1]))
        retained.drop_before((k - 10) * BLOCK)
    assert (retained.first, retained.end) == (9 * BLOCK, BLOCKS * BLOCK)
    result = retained.cut(4000, 4300, ("pelvis",))["pelvis"]
    indices = np.arange(4000, 4300)
    np.testing.assert_array_equal(result.acc, np.repeat(indices[:, None], 3, axis=1))
    np.testing.assert_array_equal(result.gyr, -result.acc)
    np.testing.assert_array_equal(result.valid, indices % 3 == 0)
    np.testing.assert_array_equal(result.interpolated, indices % 3 != 0)


def test_what_was_forgotten_is_not_cut() -> None:
    retained = KeptSamples(1)
    retained.append(block(0), np.array([0]))
    retained.drop_before(100)
    assert len(retained.cut(0, 150, ("pelvis",))["pelvis"].acc) == 50
