"""Stride lengths of single feet on gaitmap_foot against motion capture, limits of
docs/science/real-recordings.md, "Limits".

The recording starts in motion and rests only at its end: the filter starts mid-walk with wide uncertainty and
gyroscope biases from that rest. Impact rule and noise were chosen on this recording and on neura_walk
(docs/science/erkf.md, "Parameters"), so results show what is achievable here. A stride is the horizontal
displacement of the sensor from stance to stance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from sagittal.core import calibration
from sagittal.core.body import BodyModel
from sagittal.core.body.corrected import correct_signals
from sagittal.core.body.erkf.filter import ErkfTrack, erkf_inputs, filter_block
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.poses import ErkfRun, run_erkf
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.still import FOOT_STILL, still_samples
from sagittal.core.body.tree import person_tree
from sagittal.core.frames import FOOT, GRAVITY, SIDES, Floats, Side
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.parameters import measure_distances
from sagittal.core.rotation import rotate
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.timeline import synchronise
from tests.helpers.gaitmap import COPIES, RATE, analysed, block_mean, recording_of, signals, true_strides
from validation.figures import record, record_in_short

BODY = BodyModel.from_height(1.70)
"""Only its foot is used, and that only for turning strides: the sensor's path needs no body."""

OFFLINE = ErkfParams.offline()
UNKNOWN = np.degrees(OFFLINE.moving_gyr_bias_sd)
SETS = {"live": ErkfParams.live(), "offline": OFFLINE}


@dataclass(frozen=True, eq=False)
class Found:
    """Stride errors of one foot in mm, straight and turning."""

    straight: Floats
    turning: Floats

    @property
    def row(self) -> list[str]:
        """Cells of the table."""
        e = self.straight
        return [str(len(e)), f"{e.mean():+.1f} ± {e.std():.1f}", f"{np.abs(e).max():.0f}"]


def errors(p: Floats, side: Side, rate_hz: float) -> Found:
    """Found minus true stride lengths of a path (n, 3) in m."""
    result: tuple[list[float], list[float]] = [], []
    for stride in true_strides(side):
        a, b = (min(round(t * rate_hz), len(p) - 1) for t in (stride.start_s, stride.end_s))
        length = float(np.linalg.norm((p[b] - p[a])[:2]))
        result[stride.turning].append(1000 * (length - stride.length_m))
    return Found(np.array(result[False]), np.array(result[True]))


@cache
def take(copy: str = COPIES[0], half_rate: bool = False) -> tuple[CalibratedRecording, Orientations]:
    x, rate = (block_mean(copy), RATE / 2) if half_rate else (signals(copy), RATE)
    calibrated = calibration.calibrate(synchronise(recording_of(x, rate)))
    return calibrated, estimate_orientations(calibrated)


@cache
def run(
    side: Side, copy: str = COPIES[0], half_rate: bool = False, impact: float = OFFLINE.impact
) -> ErkfRun:
    """One foot alone through the product's ErKF and smoother."""
    calibrated, orientations = take(copy, half_rate)
    return run_erkf(calibrated, orientations, BODY, (FOOT[side],), replace(OFFLINE, impact=impact))


def refused_share(source: ErkfRun) -> float:
    return float(source.track.refused.sum() / source.inputs.contact.sum())


@cache
def live(side: Side, name: str) -> ErkfTrack:
    """The filter alone, sample by sample, started from gravity; only the bias is from the rest at the end."""
    params = SETS[name]
    calibrated, _ = take()
    mount = {FOOT[side]: calibrated.calibration.segments[FOOT[side]].R_segment_sensor}
    tree = person_tree(BODY, mount, (FOOT[side],))
    inputs = erkf_inputs(tree, *correct_signals(calibrated, (FOOT[side],)), RATE)
    first = start_state(tree, inputs, params, bias_age_s=calibrated.calibration.zero[0])
    return filter_block(first, inputs, tree, params)[0]


@cache
def naive(side: Side, dedrift: bool) -> Floats:
    """Path (n, 3) by plain strapdown integration: velocity is zero in stance, integrated in between.

    Orientation and stances are the product's. `dedrift`: what velocity is left at the next stance is taken
    off linearly over the swing, the usual remedy.
    """
    calibrated, orientations = take()
    (acc, gyr, valid), segment = correct_signals(calibrated, (FOOT[side],)), FOOT[side]
    still = still_samples(acc[:, 0], gyr[:, 0], valid[:, 0], RATE, FOOT_STILL)
    mount = calibrated.calibration.segments[segment].R_segment_sensor
    a = rotate(orientations.q[segment], acc[:, 0] @ mount.T) - np.array([0.0, 0.0, GRAVITY])
    v = np.zeros_like(a)
    edges = np.flatnonzero(np.diff(np.concatenate(([True], still, [True])).astype(int)))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        v[start:stop] = np.cumsum(a[start:stop], axis=0) / RATE
        if dedrift:
            v[start:stop] -= np.linspace(0.0, 1.0, stop - start)[:, None] * v[stop - 1]
    return np.asarray(np.cumsum(v, axis=0) / RATE)


@pytest.mark.parametrize("side", SIDES)
def test_straight_strides_agree_with_motion_capture(side: Side) -> None:
    result = run(side)
    e = errors(result.track.p[:, 0], side, RATE).straight
    assert len(e) >= 26
    assert abs(e.mean()) <= 8.0
    assert e.std() <= 18.0
    assert np.abs(e).max() <= 60.0
    assert refused_share(result) < 0.02
    assert abs(result.track.p[-1, 0, 2] - result.track.p[0, 0, 2]) <= 0.30


@pytest.mark.parametrize("side", SIDES)
def test_half_the_rate_is_enough_where_samples_are_averages(side: Side) -> None:
    e = errors(run(side, half_rate=True).track.p[:, 0], side, RATE / 2).straight
    assert e.std() <= 30.0


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", SETS)
def test_the_filter_alone_is_good_enough_to_watch(side: Side, name: str) -> None:
    assert errors(live(side, name).p[:, 0], side, RATE).straight.std() <= 45.0


@pytest.mark.parametrize("side", SIDES)
def test_without_the_impact_rule_the_gate_locks_out(side: Side) -> None:
    """docs/science/erkf.md, "Impacts": with constant noise, refusals at every stance and strides ± 40 mm."""
    result = run(side, impact=0.0)
    assert refused_share(result) > 0.1
    assert errors(result.track.p[:, 0], side, RATE).straight.std() > 40.0


@pytest.mark.parametrize("side", SIDES)
def test_how_the_sensor_is_turned_on_the_shoe_does_not_matter(side: Side) -> None:
    one, second = (errors(run(side, copy).track.p[:, 0], side, RATE).straight for copy in COPIES)
    np.testing.assert_allclose(one, second, atol=0.5)


@pytest.mark.parametrize("side", SIDES)
def test_the_product_measures_the_same_feet(side: Side) -> None:
    """Two feet through the whole chain; the ankle's way instead of the sensor's."""
    feet = analysed().feet
    assert feet is not None
    assert feet.source == "erkf_feet"
    assert not feet.linked
    e = errors(feet.p[side], side, feet.rate_hz).straight
    assert abs(e.mean()) <= 8.0
    assert e.std() <= 18.0
    assert np.abs(e).max() <= 60.0


def reported(side: Side) -> tuple[Floats, Floats]:
    """Errors of the strides that the report counts: lengths in mm, speeds in mm/s."""
    analysis = analysed()
    assert analysis.strides is not None
    figures = measure_distances(analysis.strides, analysis.feet)
    columns = (figures[name].values for name in ("stride_length_m", "gait_speed_mps"))
    result = []
    for stride, length, speed in zip(analysis.strides.strides, *columns, strict=True):
        for true in true_strides(side):
            same = abs(stride.start_s - true.first_ic_s) < 0.05 and abs(stride.end_s - true.last_ic_s) < 0.05
            if stride.side == side and stride.excluded_reason is None and same:
                assert np.isfinite([length, speed]).all()
                true_speed = true.length_m / (true.last_ic_s - true.first_ic_s)
                result.append((1000 * (length - true.length_m), 1000 * (speed - true_speed)))
    return np.array(result).T[0], np.array(result).T[1]


@pytest.mark.parametrize("side", SIDES)
def test_the_report_counts_these_lengths_and_speeds(side: Side) -> None:
    lengths, speeds = reported(side)
    assert len(lengths) >= 21
    assert abs(lengths.mean()) <= 8.0
    assert lengths.std() <= 18.0
    assert abs(speeds.mean()) <= 10.0


def test_the_filter_beats_plain_integration_on_both_feet() -> None:
    for side in SIDES:
        ours = errors(run(side).track.p[:, 0], side, RATE).straight
        for dedrift in (False, True):
            plain = errors(naive(side, dedrift), side, RATE).straight
            assert np.sqrt(np.mean(plain**2)) > 1.5 * np.sqrt(np.mean(ours**2))


def test_write_down_the_figures() -> None:
    rows, turns, speed, short, plain = [], [], [], [], []
    for side in SIDES:
        process, half, constant = run(side), run(side, half_rate=True), run(side, impact=0.0)
        feet = analysed().feet
        assert feet is not None
        unknown = replace(OFFLINE, start_gyr_bias_sd=OFFLINE.moving_gyr_bias_sd)
        biased = run_erkf(*take(), BODY, (FOOT[side],), unknown)
        paths: list[tuple[str, Floats, float, ErkfRun | None]] = [
            ("ErKF 15 states + smoother", process.track.p[:, 0], RATE, process),
            ("the same through the product, ankle", feet.p[side], RATE, None),
            ("the same, 102.4 Hz block mean", half.track.p[:, 0], RATE / 2, half),
            ("filter only, live set (9 states)", live(side, "live").p[:, 0], RATE, None),
            ("filter only, offline set (15 states)", live(side, "offline").p[:, 0], RATE, None),
            ("smoother, without the impact rule", constant.track.p[:, 0], RATE, constant),
            (f"smoother, biases unknown ({UNKNOWN:.1f} °/s)", biased.track.p[:, 0], RATE, biased),
            ("plain integration between stances", naive(side, False), RATE, None),
            ("plain integration, linear de-drift", naive(side, True), RATE, None),
        ]
        for name, p, rate, owner in paths:
            result = errors(p, side, rate)
            notices = ["", ""]
            if owner is not None:
                height = owner.track.p[-1, 0, 2] - owner.track.p[0, 0, 2]
                notices = [f"{100 * refused_share(owner):.1f}", f"{height:+.2f}"]
            rows.append([side, name, *result.row, *notices])
        lengths, speeds = reported(side)
        notices = [
            str(len(lengths)),
            f"{lengths.mean():+.1f} ± {lengths.std():.1f}",
            f"{np.abs(lengths).max():.0f}",
        ]
        rows.append([side, "the report's counted strides", *notices, "", ""])
        short.append(f"{side} {lengths.mean():+.1f} ± {lengths.std():.1f} (n={len(lengths)})")
        plain.append(f"{side} {rows[-2][3]}")
        speed.append(f"{side} {speeds.mean():+.0f} ± {speeds.std():.0f}")
        path = errors(process.track.p[:, 0], side, RATE).turning
        turns.append(f"{side} " + ", ".join(f"{x:+.0f}" for x in path))
    record_in_short(
        "Stride length mm",
        f"integration with linear de-drift: {', '.join(plain)}",
        ", ".join(short),
        "gaitmap_foot, 1 person, counted strides of about 1375 mm, against motion capture",
    )
    record(
        "Stride length on gaitmap_foot",
        ["foot", "run", "strides", "mean ± SD mm", "largest mm", "ZUPT refused %", "end height m"],
        rows,
        "Found − motion capture (mean of three markers), straight strides of about 1375 mm, one healthy "
        "person, 2 × 20 m at 204.8 Hz. The take begins in motion and rests at its end, from where the "
        "gyroscope biases are. Limits: |mean| ≤ 8, SD ≤ 18, none over 60 mm, refused < 2 %, end height ≤ "
        "0.3 m; SD ≤ 30 mm at 102.4 Hz, ≤ 45 mm for the filter alone. The impact rule was found on this "
        "recording, nothing else was. Turning strides, way of the sensor against the mean marker (the lever "
        f"between them counts, no limit), mm: {'; '.join(turns)}; the left one holds two steps. "
        f"Walking speed of the counted strides, found − motion capture in mm/s: {', '.join(speed)}.",
    )
