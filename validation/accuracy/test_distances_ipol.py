"""Distances of feet without still periods: ipol_walks, and gaitmap_foot without zero velocities.

A lane of 10 m was walked in both directions. Turning points are unknown, so both directions of one foot are
compared, and its distance to the start at the end.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.body import BodyModel
from sagittal.core.body.erkf import filter as erkf_filter
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.poses import run_erkf
from sagittal.core.body.still import QUIETEST, contact_samples
from sagittal.core.frames import FOOT, SIDES, Bools, Floats, Side
from sagittal.core.parameters import measure_distances
from sagittal.core.pipeline import analyse
from sagittal.core.pipeline.analysis import TakeAnalysis
from tests.helpers.gaitmap import COPIES, recording_of, resampled, true_strides
from tests.helpers.gaitmap import RATE as GAITMAP_RATE
from tests.helpers.ipol import FEET, RATE, WALKS, checked_events, first_s, ipol_analysis, ipol_recording
from validation.accuracy.test_gaitmap_strides import errors, take
from validation.figures import record

BODY = BodyModel.from_height(1.70)
BEFORE_S, AFTER_S = 0.3, 0.8
"""Around the checked walk: the feet stand."""

LOST = ("12-3", "12-4")
"""Walks in which up to a fifth of a foot's packets is lost."""

HOLE = 6
"""Packets taken out of one swing in three of gaitmap_foot at 100 Hz."""


def counted(walk: str) -> int:
    """Counted strides with a length."""
    measured = ipol_analysis(walk, *FEET).measured
    assert measured is not None
    return sum(p.n for p in measured.parameters if p.name == "stride_length_m")


def ways(walk: str, side: Side) -> tuple[float, float, float]:
    """Straight ways of one foot to the turn, back, and from its first place to its last, m."""
    feet, events = ipol_analysis(walk, *FEET).feet, checked_events(walk)
    assert feet is not None
    off, p = first_s(ipol_recording(walk, *FEET)), feet.p[side][:, :2]
    times = (events.walk_s[0] - BEFORE_S, float(np.mean(events.turn_s)), events.walk_s[1] + AFTER_S)
    first, turn, last = (p[int(np.clip((t - off) * RATE, 0, len(p) - 1))] for t in times)
    target, back, apart = turn - first, last - turn, last - first
    return tuple(float(np.linalg.norm(x)) for x in (target, back, apart))  # type: ignore[return-value]


@cache
def never_still(side: Side) -> Floats:
    """Stride errors on gaitmap_foot in mm where only the quietest moment of each stance is taken."""
    deaf = replace(QUIETEST, still=replace(QUIETEST.still, shortest_s=1e9))

    def quietest(acc: Floats, gyr: Floats, valid: Bools, rate_hz: float) -> tuple[Bools, Floats]:
        return contact_samples(acc, gyr, valid, rate_hz, deaf)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(erkf_filter, "contact_samples", quietest)
        erkf = run_erkf(*take(), BODY, (FOOT[side],), ErkfParams.offline())
    return errors(erkf.track.p[:, 0], side, GAITMAP_RATE).straight


@cache
def thinned() -> tuple[TakeAnalysis, dict[Side, set[int]]]:
    """gaitmap_foot at 100 Hz without some packets of some swings, and which strides these were."""
    whole = recording_of(resampled(COPIES[0], RATE), RATE)
    rng, streams, hit = np.random.default_rng(1), {}, {}
    for device, segment in whole.segments.items():
        side: Side = "left" if segment == "foot_l" else "right"
        stream, strides = whole.streams[device], true_strides(side)
        hit[side] = set(range(1, len(strides), 3))
        stored_mask = np.ones(len(stream.t_s), np.bool_)
        for j in hit[side]:
            s, into = strides[j], rng.uniform(0.7, 0.9)
            first = round((s.first_ic_s + into * (s.last_ic_s - s.first_ic_s)) * RATE)
            stored_mask[first : first + HOLE] = False
        assert stream.gyr is not None
        streams[device] = replace(
            stream,
            t_s=stream.t_s[stored_mask],
            acc=stream.acc[stored_mask],
            gyr=stream.gyr[stored_mask],
            digest=device,
        )
    return analyse(replace(whole, streams=streams)), hit


def test_a_stride_with_lost_packets_in_its_swing_has_no_distance_and_the_others_are_right() -> None:
    analysis, hit = thinned()
    assert analysis.strides is not None
    assert analysis.feet is not None
    reasons = measure_distances(analysis.strides, analysis.feet)["stride_length_m"].reasons
    withheld = 0
    for stride, reason in zip(analysis.strides.strides, reasons, strict=True):
        for j, true in enumerate(true_strides(stride.side)):
            same = abs(stride.start_s - true.first_ic_s) < 0.1 and abs(stride.end_s - true.last_ic_s) < 0.1
            if same and j in hit[stride.side]:
                assert reason == "packets_lost"
                withheld += 1
    assert withheld >= 12
    for side in SIDES:
        result = []
        p = analysis.feet.p[side]
        for j, true in enumerate(true_strides(side)):
            if j not in hit[side] and not true.turning:
                a, b = (min(round(t * RATE), len(p) - 1) for t in (true.start_s, true.end_s))
                result.append(1000 * (float(np.linalg.norm((p[b] - p[a])[:2])) - true.length_m))
        assert abs(np.mean(result)) <= 12.0
        assert np.std(result) <= 30.0


@pytest.mark.parametrize("side", SIDES)
def test_one_moment_in_each_stance_is_nearly_as_good_as_all_of_its_rest(side: Side) -> None:
    e = never_still(side)
    assert len(e) >= 26
    assert abs(e.mean()) <= 15.0
    assert e.std() <= 20.0


def test_brisk_walkers_have_distances_and_no_foot_is_said_never_to_rest() -> None:
    for walk in WALKS:
        assert "foot_never_still" not in {n.code for n in ipol_analysis(walk, *FEET).notices}
        assert counted(walk) >= (8 if walk in LOST else 12)


def test_nobody_is_told_to_wear_the_feet_exchanged() -> None:
    assert not any("feet_exchanged" in {n.code for n in ipol_analysis(w, *FEET).notices} for w in WALKS)


def test_the_way_back_is_as_long_as_the_way_there() -> None:
    values = np.array([ways(w, side) for w in WALKS if w not in LOST for side in SIDES])
    assert abs(np.mean(values[:, 1] - values[:, 0])) <= 0.2
    assert np.std(values[:, 1] - values[:, 0]) <= 0.4
    assert np.median(values[:, 2]) <= 0.6


def test_the_figures_are_in_the_document() -> None:
    rows = []
    for person in ("11", "12", "13", "14"):
        walks = [w for w in WALKS if w.startswith(person) and w not in LOST]
        values = np.array([ways(w, side) for w in walks for side in SIDES])
        off = values[:, 1] - values[:, 0]
        rows.append([
            person,
            str(len(walks)),
            str(min(counted(w) for w in walks)),
            *(f"{values[:, i].mean():.2f} ± {values[:, i].std(ddof=1):.2f}" for i in range(2)),
            f"{off.mean():+.2f} ± {off.std(ddof=1):.2f}",
            f"{np.median(values[:, 2]):.2f}",
        ])  # fmt: skip
    moments = ", ".join(
        f"{side} {never_still(side).mean():+.1f} ± {never_still(side).std():.1f}" for side in SIDES
    )
    record(
        "Distances on ipol_walks",
        ("person", "walks", "fewest counted strides", "way there m", "way back m", "back − there m",
         "end to start m, median"),
        rows,
        "Feet alone, each foot by itself, a lane of 10 m there and back; where the foot stood in the turn is "
        f"not known. Without {' and '.join(LOST)}, in which packets were lost. Limits: back − there within "
        "0.2 ± 0.4 m, at least 12 counted strides in every walk. gaitmap_foot with the quietest moment of "
        f"each stance only, as if no foot ever rested, stride length in mm: {moments}; limits 15 ± 20.",
    )  # fmt: skip
