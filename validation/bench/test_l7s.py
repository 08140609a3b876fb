"""Speed of the L7S step against the paper's 2 ms and against the same step written with matrices."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from sagittal.core.body.l7s.filter import L7sInputs, L7sParams, Worn, filter_block, start_l7s_state
from sagittal.core.body.l7s.inputs import free_acceleration, take_of
from sagittal.core.body.l7s.legs import LegModel
from sagittal.core.body.l7s.poses import compile_l7s_kernel
from sagittal.core.body.l7s.smoother import smooth_track
from sagittal.core.body.still import FOOT_STILL, still_samples
from sagittal.core.calibration import calibrate
from sagittal.core.frames import FOOT, SIDES
from sagittal.core.fusion.mahony import estimate_orientations
from tests.helpers.l7s_textbook import textbook
from tests.helpers.pairs import in_pairs
from tests.helpers.walks import simulated
from validation.figures import record_goal

RATE = 100.0
STEP_US = 50.0
"""Issue 3; the paper's MATLAB takes 2000."""

CALL_MS = 1.0
"""A live block of 10 samples."""

RATIO = 20.0
"""The step in matrices against ours, at least; the same figure as the ErKF has to reach."""


@cache
def walk(worn: Worn) -> tuple[L7sInputs, LegModel]:
    """Inputs of a simulated walk."""
    recording, truth = simulated("comfortable", 2)
    calibrated = calibrate(recording)
    orientations = estimate_orientations(calibrated)
    steps = {}
    for side in SIDES:
        x = recording.sensors[FOOT[side]]
        gyr = x.gyr - calibrated.calibration.segments[FOOT[side]].gyro_bias
        steps[side] = still_samples(x.acc, gyr, x.valid, RATE, FOOT_STILL)
    model = LegModel.of(truth.body)
    take = take_of(orientations, free_acceleration(calibrated, orientations), steps, model, worn)
    return take.part(slice(None)), model


def best(run: Callable[[], object], times: int = 5) -> float:
    """Shortest time in s on one core, without competing load."""
    result = []
    for _ in range(times):
        began = time.process_time()
        run()
        result.append(time.process_time() - began)
    return min(result)


@pytest.mark.parametrize("adjoint", ["printed", "exact"])
@pytest.mark.parametrize("worn", ["3I", "2I"])
def test_the_compiled_step_gives_what_the_form_with_matrices_gives(worn: Worn, adjoint: str) -> None:
    inputs, model = walk(worn)
    part = inputs.part(slice(400, 1600))
    params = L7sParams(adjoint=adjoint)  # type: ignore[arg-type]
    p, R = textbook(part, model, params, RATE)
    ours, _ = filter_block(start_l7s_state(part, model, params), part, model, RATE, params)
    np.testing.assert_allclose(ours.p, p, atol=1e-8)
    np.testing.assert_allclose(ours.R, R, atol=1e-8)


@pytest.mark.parametrize("worn", ["3I", "2I"])
def test_a_step_takes_at_most_fifty_microseconds_and_a_twentieth_of_the_form_with_matrices(
    worn: Worn,
) -> None:
    inputs, model = walk(worn)
    few = inputs.part(slice(600, 1000))
    compile_l7s_kernel()
    ours, theirs = [], []
    # interleaved, so that a busy moment of the machine meets both
    for _ in range(3):
        ours.append(best(lambda: filter_block(start_l7s_state(inputs, model), inputs, model, RATE), 2))
        theirs.append(best(lambda: textbook(few, model, L7sParams(), RATE), 1))
    step, matrices = min(ours) / len(inputs.step) * 1e6, min(theirs) / len(few.step) * 1e6
    print(f"\nL7S-{worn} {step:.1f} µs/step, with matrices {matrices:.0f}, ratio {matrices / step:.0f}")
    record_goal(f"L7S-{worn}, a step", 10.0, step, "µs")
    assert step <= STEP_US
    assert matrices / step >= RATIO


@pytest.mark.parametrize("worn", ["3I", "2I"])
def test_the_whole_take_at_once_costs_little_more_than_twice_the_filter(worn: Worn) -> None:
    inputs, model = walk(worn)
    compile_l7s_kernel()
    state, valid = start_l7s_state(inputs, model), np.ones((len(inputs.step), 3), bool)
    track, _ = filter_block(state, inputs, model, RATE)
    smoothed, filtered = [], []
    for _ in range(3):
        smoothed.append(best(lambda: smooth_track(track, inputs, valid, model, RATE), 2))
        filtered.append(best(lambda: filter_block(state, inputs, model, RATE), 2))
    ratio = min(smoothed) / min(filtered)
    print(f"\nL7S-{worn}: the whole take {ratio:.2f} times the filter")
    assert ratio < 2.4  # 1.4 to 1.6


def test_the_cost_grows_with_the_duration_and_no_faster() -> None:
    inputs, model = walk("3I")
    n = len(inputs.step)
    long = L7sInputs(
        np.tile(inputs.R, (8, 1, 1, 1)), np.tile(inputs.acc, (8, 1, 1)), np.tile(inputs.step, (8, 1)), "3I"
    )
    state = start_l7s_state(inputs, model)
    _, single, ratio = in_pairs(
        lambda: filter_block(state, long, model, RATE), lambda: filter_block(state, inputs, model, RATE)
    )
    print(f"\n{n} samples {1e3 * single:.0f} ms, eight times as many {ratio:.2f} times as long")
    assert ratio < 8.0 * 1.25


@pytest.mark.parametrize("worn", ["3I", "2I"])
def test_a_live_call_of_ten_samples_takes_at_most_a_millisecond(worn: Worn) -> None:
    inputs, model = walk(worn)
    compile_l7s_kernel()
    part = inputs.part(slice(900, 910))
    _, state = filter_block(start_l7s_state(inputs, model), inputs.part(slice(0, 900)), model, RATE)
    times = []
    for _ in range(200):
        began = time.perf_counter()
        filter_block(state, part, model, RATE)
        times.append(time.perf_counter() - began)
    typical = float(np.median(times)) * 1e3
    print(f"\nL7S-{worn}: ten samples {typical:.2f} ms")
    assert typical <= CALL_MS
