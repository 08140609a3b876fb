"""Pitch or way: who is believed about the contacts of a foot."""

from __future__ import annotations

import numpy as np

from sagittal.core.events.choice import LEAST, SAME_S, believes_way, count_seen

SWINGS = [(float(t), t + 0.4) for t in range(1, 11)]
LANDED = [on for _, on in SWINGS]


def test_contacts_beside_each_other_are_seen() -> None:
    assert count_seen(LANDED, []) == 0
    assert count_seen([], LANDED) == 0
    assert count_seen(LANDED, [t + 0.9 * SAME_S for t in LANDED]) == 10
    assert count_seen(LANDED, np.array(LANDED[:4]) - 1.1 * SAME_S) == 0


def test_a_foot_whose_pitch_tells_the_same_or_more_is_read_by_it() -> None:
    assert not believes_way(SWINGS, LANDED)
    assert not believes_way(SWINGS, LANDED[:6]), "some are missed in turns"
    between = [t + 0.7 for t in range(1, 11)]
    assert not believes_way(SWINGS, between), "the way misses every other swing"


def test_a_foot_that_is_said_to_land_on_its_way_is_not_read_by_its_pitch() -> None:
    assert believes_way(SWINGS, [])
    assert believes_way(SWINGS, [off + 0.15 for off, _ in SWINGS])
    twice = sorted(t for off, _ in SWINGS for t in (off + 0.1, off + 0.25))
    assert believes_way(SWINGS, twice), "two in every swing are not twice as many swings"
    assert not believes_way(SWINGS[: LEAST - 1], []), "two movements are no gait"
