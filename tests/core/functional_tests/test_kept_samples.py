"""The last samples as they were given, whatever was forgotten and however much room was needed."""

from __future__ import annotations

import numpy as np

from sagittal.core.functional_tests.kept_samples import KeptSamples
from sagittal.core.timeline.live import UniformBlock

BLOCK = 250
BLOCKS = 20


def block(first: int) -> UniformBlock:
    at = np.arange(first, first + BLOCK)
    acc = np.repeat(at[:, None, None], 6, axis=1).reshape(BLOCK, 2, 3).astype(float)
    even = np.stack((at % 2 == 0, at % 3 == 0), axis=1)
    return UniformBlock(first, at / 100.0, acc, -acc, even, ~even)


def test_samples_are_cut_at_their_places_after_the_room_grew_and_older_ones_were_forgotten() -> None:
    kept = KeptSamples(1)
    for k in range(BLOCKS):
        kept.append(block(k * BLOCK), np.array([1]))
        kept.drop_before((k - 10) * BLOCK)
    assert (kept.first, kept.end) == (9 * BLOCK, BLOCKS * BLOCK)
    found = kept.cut(4000, 4300, ("pelvis",))["pelvis"]
    at = np.arange(4000, 4300)
    np.testing.assert_array_equal(found.acc, np.repeat(at[:, None], 3, axis=1))
    np.testing.assert_array_equal(found.gyr, -found.acc)
    np.testing.assert_array_equal(found.valid, at % 3 == 0)
    np.testing.assert_array_equal(found.interpolated, at % 3 != 0)


def test_what_was_forgotten_is_not_cut() -> None:
    kept = KeptSamples(1)
    kept.append(block(0), np.array([0]))
    kept.drop_before(100)
    assert len(kept.cut(0, 150, ("pelvis",))["pelvis"].acc) == 50
