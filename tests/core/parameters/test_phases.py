"""The phases of Perry: boundaries put by hand, and simulated walks in which they add up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.angles import JointAngles
from sagittal.core.body.feet import FootTracks
from sagittal.core.body.model import BodyModel
from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import SIDES, Floats, Segment, Side
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.parameters.phases import NAMES, measure_phases
from sagittal.core.parameters.rows import Row, read_row, side_parameters
from sagittal.core.parameters.stance import find_stances
from sagittal.core.simulate import simulate_scenario
from tests.helpers.true_walks import true_tracks

T = np.arange(0.0, 8.0, 0.01)
BODY = BodyModel.from_height(1.7)


def feet(linked: bool = True) -> FootTracks:
    """The left foot swings 1.2 m from .6 to 1 s of every second; it passes the right one half way."""
    u = np.clip((T % 1.0 - 0.6) / 0.4, 0.0, 1.0)
    left = np.stack((1.2 * (np.floor(T) + u), np.full(len(T), 0.1), np.full(len(T), 0.07)), axis=1)
    right = np.stack((1.2 * np.floor(T) + 0.6, np.full(len(T), -0.1), np.full(len(T), 0.07)), axis=1)
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(T), 1))
    still = {s: np.zeros(len(T), np.bool_) for s in SIDES}
    valid = {s: np.ones(len(T), np.bool_) for s in SIDES}
    return FootTracks(
        T, 100.0, {"left": left, "right": right}, {"left": q, "right": q}, still, valid, linked, "truth", BODY
    )


def pitch() -> dict[Segment, Floats]:
    """Flat from .1 to .3 s of a stance of .6 s, as in test_stance, then up; in swing from −40° to 20°."""
    u = T % 1.0
    down = 18.0 * np.clip(1.0 - u * 10.0, 0.0, 1.0)
    up = -60.0 * np.clip((u - 0.3) / 0.3, 0.0, 1.0)
    swing = -60.0 + 80.0 * np.clip((u - 0.6) / 0.4, 0.0, 1.0)
    return {"foot_l": np.radians(np.where(u < 0.6, down + up, swing))}


def angles() -> JointAngles:
    return JointAngles(T, {"ankle_dorsiflexion_l": np.zeros(len(T))}, {})


STRIDE = Stride("left", 2.0, 2.6, 3.0, 2.1, 2.5)


def phases(
    stride: Stride = STRIDE,
    tracks: FootTracks | None = None,
    joint: JointAngles | None = None,
    of_feet: Mapping[Segment, Floats] | None = None,
) -> Row:
    one = Strides((stride,))
    of = dict(pitch() if of_feet is None else of_feet)
    return read_row(measure_phases(one, find_stances(one, T, of), joint or angles(), of, tracks or feet()), 0)


def test_each_phase_ends_where_its_event_is() -> None:
    found = phases()
    # the heel is 3° up at .315 s; the ankles are beside each other at .8, the shank is vertical at .9 s
    assert found["mid_stance_pct"] == pytest.approx(21.5, abs=0.5)
    assert found["terminal_stance_pct"] == pytest.approx(18.5, abs=0.5)
    assert found["initial_swing_pct"] == pytest.approx(20.0, abs=0.1)
    assert found["mid_swing_pct"] == pytest.approx(10.0, abs=0.5)
    assert found["terminal_swing_pct"] == pytest.approx(10.0, abs=0.5)


def test_dorsiflexion_brings_the_shank_upright_later() -> None:
    """Foot 10° up and ankle 10° dorsiflexed is a vertical shank."""
    bent = JointAngles(T, {"ankle_dorsiflexion_l": np.full(len(T), np.radians(10.0))}, {})
    assert phases(joint=bent)["terminal_swing_pct"] == pytest.approx(5.0, abs=0.5)


def test_a_heel_that_rises_outside_single_support_leaves_one_phase_out() -> None:
    early = phases(replace(STRIDE, opposite_tc_s=2.4))
    assert early["mid_stance_pct"] == "no_mid_stance"
    assert early["terminal_stance_pct"] == pytest.approx(10.0)
    late = phases(replace(STRIDE, opposite_tc_s=2.05, opposite_ic_s=2.3))
    assert late["mid_stance_pct"] == pytest.approx(25.0)
    assert late["terminal_stance_pct"] == "no_terminal_stance"


def test_what_is_missing_has_its_own_reason() -> None:
    assert phases(replace(STRIDE, opposite_ic_s=None))["mid_stance_pct"] == "opposite_foot_missing"
    assert phases(replace(STRIDE, tc_s=None))["initial_swing_pct"] == "no_terminal_contact"
    assert phases(tracks=feet(linked=False))["initial_swing_pct"] == "feet_not_linked"
    assert phases(tracks=feet(linked=False))["terminal_swing_pct"] == pytest.approx(10.0, abs=0.5)
    none = JointAngles(T, {}, {})
    assert phases(joint=none)["terminal_swing_pct"] == "joint_missing"
    assert phases(of_feet={})["mid_stance_pct"] == "no_foot_sensor"
    never = {s: feet().p[s] + (np.array([5.0, 0.0, 0.0]) if s == "right" else 0.0) for s in SIDES}
    assert phases(tracks=replace(feet(), p=never))["mid_swing_pct"] == "feet_not_adjacent"
    stiff = JointAngles(T, {"ankle_dorsiflexion_l": np.full(len(T), np.radians(60.0))}, {})
    assert phases(joint=stiff)["mid_swing_pct"] == "tibia_not_vertical"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comfortable", "hemiparetic"])
def test_the_seven_phases_are_the_whole_stride(name: str) -> None:
    truth = simulate_scenario(name, 5).truth
    columns = measure_gait(true_tracks(truth)).columns
    seven = [columns[n] for n in (*NAMES, "initial_double_support_pct", "terminal_double_support_pct")]
    totals = [sum(v for v in row if v is not None) for row in zip(*seven, strict=True) if None not in row]
    assert len(totals) > 20
    assert totals == pytest.approx([100.0] * len(totals))


def test_both_sides_have_every_phase() -> None:
    one = Strides((STRIDE,))
    measured = measure_phases(one, find_stances(one, T, pitch()), angles(), pitch(), feet())
    found: dict[tuple[str, Side | None], str | None] = {
        (p.name, p.side): p.reason for p in side_parameters(one, measured)
    }
    assert {reason for (_, side), reason in found.items() if side == "left"} == {None}
    assert {reason for (_, side), reason in found.items() if side == "right"} == {"no_strides"}
