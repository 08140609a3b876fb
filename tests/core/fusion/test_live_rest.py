"""When a foot's rest is looked at: once in each, whatever the blocks are."""

from __future__ import annotations

import numpy as np

from sagittal.core.fusion.live_rest import RESTED_S, RestLooks

RATE = 100.0


def test_one_look_into_each_long_rest_whatever_the_blocks_are() -> None:
    rng = np.random.default_rng(0)
    still = np.repeat(rng.random((60, 2)) < 0.5, rng.integers(1, 25, 60), axis=0)
    whole = RestLooks(2, RATE).push(still)
    need = round(RESTED_S * RATE)
    for foot in range(2):
        edges = np.flatnonzero(np.diff(np.concatenate(([0], still[:, foot].astype(int), [0]))))
        long = [a + need - 1 for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= need]
        assert len(long) > 5
        assert np.flatnonzero(whole[:, foot]).tolist() == long
    looks = RestLooks(2, RATE)
    cuts = np.array_split(still, np.unique(rng.integers(0, len(still), 40)))
    np.testing.assert_array_equal(np.concatenate([looks.push(x) for x in cuts]), whole)
