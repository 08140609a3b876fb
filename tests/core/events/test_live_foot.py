"""A streamed foot: its pitch is believed until its way contradicts it."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.events.detection import detect_contacts
from sagittal.core.events.foot_movement import FootMovement
from sagittal.core.events.foot_pitch import FootPitchParams
from sagittal.core.events.live_foot import KnownContact, LiveFoot
from sagittal.core.frames import FOOT, Side
from tests.helpers.event_scoring import match
from tests.helpers.walked_feet import walked, walked_foot

RATE = 100.0


def stream(name: str, side: Side, block: int = 50) -> list[KnownContact]:
    foot = walked_foot(name, side)
    live = LiveFoot(side, RATE, FootPitchParams(), None)
    told = []
    for k in range(0, len(foot.q), block):
        part = slice(k, k + block)
        told += live.push(foot.q[part], foot.valid[part], FootMovement(foot.speed[part], foot.acc[part]), 0)
    return told


@pytest.mark.slow
@pytest.mark.parametrize("name", ["shuffler", "dragged_foot"])
def test_a_foot_without_pitch_is_told_in_arrears(name: str) -> None:
    told = stream(name, "left")
    on = [x.event.time_s for x in told if x.event.kind == "ic"]
    found = match(on, walked_foot(name, "left").contacts.tolist(), 0.25)
    assert found.missed <= 2
    assert not found.extra
    assert all(x.final for x in told)
    assert [x.at for x in told] == sorted(x.at for x in told)
    assert told == stream(name, "left", 7), "in any blocks"


@pytest.mark.slow
def test_a_foot_that_pitches_is_told_as_in_a_file() -> None:
    orientations, motions, _ = walked("comfortable")
    whole = detect_contacts(orientations, motions=motions)
    assert not [n for n in whole.notices if n.code == "contacts_by_way"]
    last = {x.event.first_s or x.event.time_s: x.event for x in stream("comfortable", "left")}
    assert [e.time_s for e in sorted(last.values(), key=lambda e: e.time_s)] == [
        e.time_s for e in whole.events if e.side == "left"
    ]


@pytest.mark.slow
def test_a_file_says_which_foot_is_read_by_its_way() -> None:
    orientations, motions, truth = walked("dragged_foot")
    found = detect_contacts(orientations, motions=motions)
    (said,) = [n for n in found.notices if n.code == "contacts_by_way"]
    assert said.sensor == FOOT["left"]
    assert said.severity == "info"
    assert f"{len(truth.contacts['left'].contact)} initial contacts" in said.message
    assert "no_toe_off" not in {n.code for n in found.notices}
    assert np.diff([e.time_s for e in found.events]).min() >= 0.0
