"""Substitutes for a lost sensor: its last signals, then its carrier or the trunk's rotation."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.body.erkf.filter import erkf_inputs
from sagittal.core.body.erkf.gaps import HOLD_S, bridge_gaps
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.tree import ImuTree
from sagittal.core.frames import GRAVITY, Bools, Floats, Segment
from sagittal.core.rotation import rotate
from tests.core.body.erkf.walks import SEGMENTS, Take, mixed_walk, smoothed

PEOPLE = ErkfParams.people()
FROM_S = 15.0
"""The walk turns by 180° between 18 and 23 s."""


def gap(segment: Segment, lost_s: float) -> Bools:
    """Valid (T, n), without one sensor for a while."""
    take = mixed_walk()
    valid = np.ones(take.inputs.valid.shape, bool)
    start = round(FROM_S * take.rate_hz)
    valid[start : start + round(lost_s * take.rate_hz), SEGMENTS.index(segment)] = False
    return valid


def filled(valid: Bools) -> tuple[Floats, Floats]:
    """Signals bridged, no numbers where lost."""
    take = mixed_walk()
    acc, gyr = take.inputs.acc.copy(), take.inputs.gyr.copy()
    acc[~valid] = gyr[~valid] = np.nan
    return bridge_gaps(take.tree, acc, gyr, valid, take.rate_hz)


@cache
def bridged_walk(segment: Segment, lost_s: float) -> tuple[float, float]:
    """RMS error in m of the segment's distance from the pelvis in the gap, and of the worst after it."""
    take, valid = mixed_walk(), gap(segment, lost_s)
    inputs = erkf_inputs(take.tree, take.inputs.acc, take.inputs.gyr, valid, take.rate_hz)
    bad: Take = replace(take, inputs=inputs)
    track = smoothed(bad, PEOPLE)
    origin = take.tree.segment_origin(track.p, track.q)
    true = np.stack([take.truth.p[s][: len(origin)] for s in SEGMENTS], axis=1)
    # distances from the pelvis are the same in any common heading
    off = np.linalg.norm(origin - origin[:, :1], axis=2) - np.linalg.norm(true - true[:, :1], axis=2)
    i, lost = SEGMENTS.index(segment), ~valid.all(axis=1)
    final = np.flatnonzero(lost)[-1] + 200
    return float(np.sqrt(np.mean(off[lost, i] ** 2))), float(np.sqrt((off[final:] ** 2).mean(axis=0)).max())


@pytest.mark.slow
def test_a_short_loss_is_held_and_what_was_measured_stays() -> None:
    take, valid = mixed_walk(), gap("thigh_r", 2.0)
    acc, gyr = filled(valid)
    assert np.array_equal(acc[valid], take.inputs.acc[valid])
    assert np.array_equal(gyr[valid], take.inputs.gyr[valid])
    i, start = SEGMENTS.index("thigh_r"), round(FROM_S * take.rate_hz)
    held = slice(start, start + round(HOLD_S * take.rate_hz))
    assert (acc[held, i] == take.inputs.acc[start - 1, i]).all()
    assert np.isfinite(acc).all()
    assert np.isfinite(gyr).all()


def test_a_foot_goes_with_its_shank_and_a_thigh_stays_upright_and_turns_with_the_pelvis() -> None:
    take = mixed_walk()
    late = slice(round((FROM_S + HOLD_S) * take.rate_hz), round((FROM_S + 8.0) * take.rate_hz))
    foot, shank, thigh = (SEGMENTS.index(s) for s in ("foot_l", "shank_l", "thigh_l"))
    acc, gyr = filled(gap("foot_l", 8.0))
    for result, measured in ((acc, take.inputs.acc), (gyr, take.inputs.gyr)):
        segments = [rotate(take.tree.q_mount[i], result[late, i]) for i in (foot, shank)]
        np.testing.assert_allclose(segments[0], segments[1], atol=1e-12)
        assert np.array_equal(result[late, shank], measured[late, shank])
    acc, gyr = filled(gap("thigh_l", 8.0))
    np.testing.assert_allclose(np.linalg.norm(acc[late, thigh], axis=1), GRAVITY)
    up = acc[late, thigh] / GRAVITY
    turned = np.degrees(np.sum(gyr[late, thigh] * up) / take.rate_hz)
    assert turned == pytest.approx(180.0, abs=25.0)
    assert np.abs(np.cross(gyr[late, thigh], up)).max() < 1e-12


def test_without_a_neighbour_a_sensor_travels_on_upright() -> None:
    """A foot alone, and one whose whole leg and pelvis are lost with it."""
    take, foot = mixed_walk(), SEGMENTS.index("foot_l")
    tree = ImuTree(
        ("foot_l",), (), (0,), take.tree.q_mount[[foot]], take.tree.place[[foot]], take.tree.origin[[foot]]
    )
    valid = gap("foot_l", 2.0)
    single = bridge_gaps(
        tree, take.inputs.acc[:, [foot]], take.inputs.gyr[:, [foot]], valid[:, [foot]], take.rate_hz
    )
    all_lost = np.repeat(valid[:, [foot]], len(SEGMENTS), axis=1)
    together = bridge_gaps(take.tree, take.inputs.acc, take.inputs.gyr, all_lost, take.rate_hz)
    late = slice(round((FROM_S + HOLD_S) * take.rate_hz), round((FROM_S + 2.0) * take.rate_hz))
    for acc, gyr in (
        (single[0][late, 0], single[1][late, 0]),
        (together[0][late, foot], together[1][late, foot]),
    ):
        assert (gyr == 0.0).all()
        assert np.ptp(acc, axis=0).max() == 0.0
        assert np.linalg.norm(acc[0]) == pytest.approx(GRAVITY)


def test_filling_looks_only_back() -> None:
    take, valid = mixed_walk(), gap("foot_l", 4.0)
    n = round((FROM_S + 2.0) * take.rate_hz)
    whole = filled(valid)
    acc, gyr = take.inputs.acc[:n].copy(), take.inputs.gyr[:n].copy()
    part = bridge_gaps(take.tree, acc, gyr, valid[:n], take.rate_hz)
    for a, b in zip(whole, part, strict=True):
        assert np.array_equal(a[:n], b)


def test_before_its_first_sample_a_sensor_holds_that_and_no_gap_of_it_begins() -> None:
    take = mixed_walk()
    foot, first = SEGMENTS.index("foot_l"), round(2.0 * take.rate_hz)
    valid = np.ones(take.inputs.valid.shape, bool)
    valid[:first, foot] = False
    acc, gyr = filled(valid)
    assert (acc[:first, foot] == take.inputs.acc[first, foot]).all()
    assert (gyr[:first, foot] == take.inputs.gyr[first, foot]).all()


@pytest.mark.sweep
@pytest.mark.parametrize("lost_s", [2.0, 8.0, 20.0])
@pytest.mark.parametrize("segment", ["pelvis", "thigh_l", "shank_r", "foot_l"])
def test_a_sensor_lost_while_the_person_turns_comes_back_where_it_belongs(
    segment: Segment, lost_s: float
) -> None:
    inside, final = bridged_walk(segment, lost_s)
    assert inside < 0.05
    assert final < 0.01
