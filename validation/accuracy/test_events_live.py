"""Live and offline: the foot-pitch rule fed sample by sample on real feet gives the same contacts, soon."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.events import detect
from sagittal.core.events.detection import KINDS
from sagittal.core.events.foot_pitch import FootPitchParams, FootPitchState, advance_foot_pitch, pitch_signal
from sagittal.core.frames import FOOT, SIDES, Side
from sagittal.core.fusion.orientations import Orientations
from validation.accuracy.test_events_consensus import take
from validation.figures import record

WALKS = ("gaitmap_foot", "neura_walk")


def streamed(place: Orientations, side: Side, block: int) -> list[tuple[str, float, float]]:
    """(kind, time, moment it is known) of a foot, its samples arriving in blocks."""
    foot = FOOT[side]
    s, valid = pitch_signal(place.q[foot]), place.valid[foot]
    state = FootPitchState.start(place.rate_hz, FootPitchParams())
    events: list[tuple[str, float, float]] = []
    for first in range(0, len(s), block):
        part = slice(first, first + block)
        for kind, index, reference, offset in zip(
            *advance_foot_pitch(state, s[part], valid[part]), strict=True
        ):
            assert first <= reference < first + block, "an event is told in the block in which it is known"
            time = float(place.t_s[index] + offset / place.rate_hz)
            events.append((KINDS[kind], time, float(place.t_s[reference])))
    return events


@pytest.mark.parametrize("name", WALKS)
@pytest.mark.parametrize("block", [1, 7, 100])
def test_a_stream_gives_the_same_bits_as_the_file(name: str, block: int) -> None:
    address = take(name)
    offline = detect(address).events
    for side in SIDES:
        expected = [(e.kind, e.time_s, e.detected_s) for e in offline if e.side == side]
        assert sorted(streamed(address, side, block), key=lambda e: e[1]) == expected


def test_the_delay_is_written_down() -> None:
    rows = []
    for name in WALKS:
        for kind in ("tc", "ic"):
            delay = [1e3 * (e.detected_s - e.time_s) for e in detect(take(name)).events if e.kind == kind]
            assert np.median(delay) <= 60
            assert min(delay) > 0
            figures = (f"{np.median(delay):.0f}", f"{np.percentile(delay, 95):.0f}", f"{max(delay):.0f}")
            rows.append((name, kind.upper(), str(len(delay)), *figures))
    record(
        "Delay of the foot-pitch rule in a stream",
        ("walk", "event", "n", "median ms", "95 % ms", "longest ms"),
        rows,
        "From the moment of the event to the sample at which the rule knows it; sensor, radio and filter are"
        " not in it. Sample by sample and as a file it gives the same bits. Limit: median ≤ 60 ms. A contact"
        " is held until the foot has come down by 0.6° (core/events/foot_pitch.py, fall).",
    )
