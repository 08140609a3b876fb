"""The live ErKF on feet: rest, blocks, losses, and paths that a rest contradicts."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sagittal.core.body.erkf.gaps import HOLD_S
from sagittal.core.body.erkf.live_erkf import LiveErkf, SignalBlock, live_params
from sagittal.core.body.live_still import ROLLING_MPS
from sagittal.core.body.tree import person_tree
from sagittal.core.frames import GRAVITY, Floats, Segment
from sagittal.core.online import LiveStride
from sagittal.core.rotation import about, multiply
from sagittal.core.signals.recording import UniformRecording
from tests.core.body.live_standing import BODY, NEUTRAL, RATE
from tests.helpers.live_walks import live as stream
from tests.helpers.walks import cut, only, simulated

HOLD = round(HOLD_S * RATE)


def signals(samples: int) -> SignalBlock:
    """A foot in stance."""
    acc = np.tile([0.0, GRAVITY, 0.0], (samples, 1, 1))
    yes = np.ones((samples, 1), np.bool_)
    return SignalBlock(acc, np.zeros((samples, 1, 3)), yes, np.ones((samples, 1, 2), np.bool_), ~yes)


def start(first: SignalBlock | None = None, q: Floats = NEUTRAL) -> LiveErkf:
    tree = person_tree(BODY, {"foot_r": np.eye(3)}, ("foot_r",))
    return LiveErkf(tree, live_params(), RATE, signals(100) if first is None else first, q[None])


def swing(samples: int) -> SignalBlock:
    """A foot that turns and is pushed to and fro, and never rests."""
    t = np.arange(samples) / RATE
    block = signals(samples)
    block.gyr[:, 0, 2], block.acc[:, 0, 0] = np.sin(5.0 * t), 3.0 * np.cos(5.0 * t)
    block.still[:] = False
    return block


def test_the_live_set_has_nine_states_and_believes_a_rest_as_far_as_it_rolls() -> None:
    params = live_params()
    assert (params.states, params.joint_centre_sd, params.zero_velocity_sd) == (9, 0.03, ROLLING_MPS)


def test_a_foot_that_stands_stays_where_it_is() -> None:
    states, residual = start().push(signals(100))
    assert states.shape == (100, 1, 16)
    assert residual.shape == (100, 0)
    assert states[:, 0, 6:10] == pytest.approx(np.tile(NEUTRAL, (100, 1)), abs=1e-9)
    assert states[:, 0, 3:6] == pytest.approx(0.0, abs=1e-9)
    assert np.ptp(states[:, 0, :3], axis=0) == pytest.approx(0.0, abs=1e-9)


def test_any_division_into_blocks_gives_the_same_bits() -> None:
    parts = [signals(100), swing(80), signals(60)]
    parts[1].valid[40:] = False
    whole = SignalBlock(*(np.concatenate(x) for x in zip(*parts, strict=True)))
    expected = start(whole.part(0, 100)).push(whole)[0]
    assert np.isnan(expected[:, 0, 0]).any()
    live = start(whole.part(0, 100))
    edges = (0, 100, 101, 140, 150, 190, 240)
    result = [live.push(whole.part(a, b))[0] for a, b in pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(result), expected)


def test_a_lost_foot_is_shown_until_the_hold_ends_and_again_from_its_next_rest_on() -> None:
    live = start()
    live.push(signals(100))
    lost = swing(HOLD + 5)
    lost.valid[:] = False
    states = live.push(lost)[0][:, 0, 0]
    assert np.isfinite(states[:HOLD]).all()
    assert np.isnan(states[HOLD:]).all()
    assert np.isnan(live.push(swing(20))[0]).all(), "there again, and still on its way"
    back = live.push(signals(10))[0][:, 0]
    assert np.isfinite(back).all()
    assert back[:, 3:6] == pytest.approx(0.0, abs=0.05)


def test_a_foot_that_rests_again_is_level_and_faces_where_it_did() -> None:
    live = start(q=multiply(about(2, 0.4), NEUTRAL))
    live.push(signals(100))
    lost = swing(HOLD + 1)
    lost.valid[:] = False
    # what it was told while lost: a quarter turn about its z axis
    lost.gyr[:] = (0.0, 0.0, 0.5 * np.pi / len(lost.gyr) * RATE)
    live.push(lost)
    (state,) = live.push(signals(1))[0][:, 0]
    up = multiply(
        multiply(state[6:10], np.array([0.0, 0.0, 1.0, 0.0])), state[6:10] * [1.0, -1.0, -1.0, -1.0]
    )
    assert up[1:] == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    assert state[3:6] == pytest.approx(0.0, abs=1e-6)


def test_what_no_foot_does_breaks_it_for_good() -> None:
    live = start()
    live.push(signals(100))
    assert not live.broken
    mad = signals(20)
    mad.acc[10:] = 1e14
    states, residual = live.push(mad)
    assert live.broken
    assert np.isfinite(states[:10]).all()
    assert np.isnan(states[-1]).all()
    second_frame, _ = live.push(signals(5))
    assert np.isnan(second_frame).all()
    assert residual.shape == (20, 0)


STRIDE_S = 1.1
"""From the fault on: the stride that it falls into has no length."""


def repeated(recording: UniformRecording, segment: Segment, start_s: float, end_s: float) -> UniformRecording:
    """The same take in which one sensor sends its last sample again for a while, as if it were measured."""
    x = recording.sensors[segment]
    a, b = round(start_s * recording.rate_hz), round(end_s * recording.rate_hz)
    acc, gyr = x.acc.copy(), x.gyr.copy()
    acc[a:b], gyr[a:b] = acc[a - 1], gyr[a - 1]
    return replace(recording, sensors={**recording.sensors, segment: replace(x, acc=acc, gyr=gyr)})


def strides_of(take: UniformRecording, size: int = 10) -> list[LiveStride]:
    """Last reported version of finished strides."""
    by_n = {s.n: s for f in stream(take, size)[1] for s in f.strides}
    return [s for s in by_n.values() if s.complete]


@pytest.mark.slow
@pytest.mark.parametrize(("start_s", "length_s"), [(15.5, 0.2), (15.9, 0.3)])
def test_a_path_that_its_rest_contradicts_begins_anew(start_s: float, length_s: float) -> None:
    """Too short to be called a frozen sensor; all strides after it were half or three times as long."""
    take = only(cut(simulated("comfortable", 1)[0], 0.0, 22.0), "foot_l", "foot_r")
    whole = strides_of(take)
    strides = strides_of(repeated(take, "foot_l", start_s, start_s + length_s))
    final = [s for s in strides if s.start_s > start_s + STRIDE_S and s.counted]
    assert {s.side for s in final} == {"left", "right"}
    for s in strides:
        length = s.values["stride_length_m"]
        same = [x for x in whole if x.side == s.side and abs(x.end_s - s.end_s) < 0.1]
        if not s.counted or not same or same[0].values["stride_length_m"] is None:
            continue
        if length is None:
            assert s not in final, (s.side, s.end_s, s.reasons["stride_length_m"])
        else:
            assert length == pytest.approx(same[0].values["stride_length_m"], abs=0.1), (s.side, s.end_s)


def test_it_begins_anew_at_the_same_sample_whatever_the_blocks_are() -> None:
    take = only(cut(simulated("comfortable", 1)[0], 0.0, 18.0), "foot_l", "foot_r")
    take = repeated(take, "foot_l", 15.3, 15.6)
    by_size = [[(s.n, dict(s.values)) for s in strides_of(take, size)] for size in (10, 37)]
    assert by_size[0] == by_size[1]
