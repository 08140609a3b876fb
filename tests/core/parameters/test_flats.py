"""The flats of all strides at once are those that a search finds contact by contact."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

from sagittal.core.body.feet import FootTracks
from sagittal.core.body.model import BodyModel
from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import SIDES, Side
from sagittal.core.parameters.flats import OTHER, STANCE_SHARE, find_flats
from sagittal.core.signals.rest import find_runs

N = 3000
BODY = BodyModel(hip_width=0.18, thigh=0.42, shank=0.42, ankle_height=0.08, foot=0.26, estimated=True)


def search(strides: Strides, feet: FootTracks) -> dict[tuple[Side, float], int]:
    """Foot and contact → middle of its longest rest until the foot leaves again, −1 without one."""
    leaves: dict[tuple[Side, float], float] = {}
    for s in strides.strides:
        stance = STANCE_SHARE * s.duration_s
        leaves.setdefault((s.side, s.end_s), s.end_s + stance)
        if s.opposite_ic_s is not None:
            leaves.setdefault((OTHER[s.side], s.opposite_ic_s), s.opposite_ic_s + stance)
    for s in strides.strides:
        off = s.start_s + STANCE_SHARE * s.duration_s if s.tc_s is None else s.tc_s
        leaves[s.side, s.start_s] = min(off, leaves.get((s.side, s.start_s), inf))
    found = {}
    for (side, start), end in leaves.items():
        first, past = np.searchsorted(feet.t_s, (start, end)).tolist()
        within = [
            (max(a, first), min(b, past)) for a, b in find_runs(feet.still[side]) if b > first and a < past
        ]
        a, b = max(within, key=lambda r: r[1] - r[0], default=(0, -1))
        found[side, start] = (a + b) // 2 if b > a else -1
    return found


def walked(seed: int) -> tuple[Strides, FootTracks]:
    """Strides of uneven length with contacts left out, on feet that rest now and then."""
    rng = np.random.default_rng(seed)
    contacts = {s: np.cumsum(rng.uniform(0.6, 1.6, 20)).tolist() for s in SIDES}
    made = []
    for side in SIDES:
        for a, b in zip(contacts[side][:-1], contacts[side][1:], strict=True):
            landings = [t for t in contacts[OTHER[side]] if a < t < b]
            off = None if rng.random() < 0.2 else a + float(rng.uniform(0.4, 0.8)) * (b - a)
            opposite = landings[0] if len(landings) == 1 else None
            made.append(Stride(side, a, off, b, opposite_ic_s=opposite))
    still = {s: np.repeat(rng.random(N // 10) < 0.6, 10) for s in SIDES}
    t = np.arange(N) / 100.0
    nowhere = {s: np.zeros((N, 3)) for s in SIDES}
    q = {s: np.tile((1.0, 0.0, 0.0, 0.0), (N, 1)) for s in SIDES}
    feet = FootTracks(t, 100.0, nowhere, q, still, dict.fromkeys(SIDES, np.ones(N, bool)), True, "made", BODY)
    return Strides(tuple(sorted(made, key=lambda s: s.start_s))), feet


@pytest.mark.parametrize("seed", range(5))
def test_flats_are_those_of_a_search_contact_by_contact(seed: int) -> None:
    strides, feet = walked(seed)
    expected, found = search(strides, feet), find_flats(strides, feet)
    assert found.first.tolist() == [expected[s.side, s.start_s] for s in strides.strides]
    assert found.last.tolist() == [expected[s.side, s.end_s] for s in strides.strides]
    assert found.opposite.tolist() == [
        -1 if s.opposite_ic_s is None else expected[OTHER[s.side], s.opposite_ic_s] for s in strides.strides
    ]
    assert -1 in found.opposite
    assert (found.first >= 0).any()
