"""What goes into L7S, against the equations written with whole arrays."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from sagittal.core.body import BodyModel
from sagittal.core.body.l7s.inputs import KnownSamples, arrange_inputs, remove_gravity
from sagittal.core.body.l7s.legs import BODIES, LegModel
from sagittal.core.frames import GRAVITY, Bools, Floats
from sagittal.core.rotation import exp, from_matrix, rotate, to_matrix
from sagittal.core.signals.calibrated import SegmentCalibration

MODEL = LegModel.of(BodyModel.from_height(1.7))
N = 300


def poses(seed: int = 4) -> tuple[Floats, Floats]:
    """Poses of pelvis and feet around standing, in Sy's frames."""
    rng = np.random.default_rng(seed)
    R = to_matrix(exp(rng.normal(0.0, 0.6, (N, 3, 3))))
    return R, np.array([[0.0, 0.0, 0.9], [0.0, 0.1, 0.1], [0.0, -0.1, 0.1]]) + rng.normal(
        0.0, 0.05, (N, 3, 3)
    )


@pytest.mark.parametrize("worn", ["3I", "2I"])
def test_inputs_are_measured_orientations_in_the_frames_of_the_paper(worn: str) -> None:
    R, acc = poses()
    q = {s: from_matrix(R[:, b] @ MODEL.to_isb(s)) for b, s in enumerate(BODIES)}
    step = np.zeros((N, 2), bool)
    result = arrange_inputs(q, {s: acc[:, b] for b, s in enumerate(BODIES)}, step, MODEL, worn)  # type: ignore[arg-type]
    np.testing.assert_allclose(result.R[:, 1:], R[:, 1:], atol=1e-12)
    pelvis = (R[:, 0], acc[:, 0]) if worn == "3I" else (np.eye(3), 0.5 * (acc[:, 1] + acc[:, 2]))
    np.testing.assert_allclose(result.R[:, 0], np.broadcast_to(pelvis[0], (N, 3, 3)), atol=1e-12)
    np.testing.assert_allclose(result.acc[:, 0], pelvis[1], atol=1e-12)


def test_gravity_and_what_the_norm_at_rest_is_over_it_are_taken_off() -> None:
    rng = np.random.default_rng(5)
    q, mount = exp(rng.normal(0.0, 1.0, (N, 3))), to_matrix(exp(rng.normal(0.0, 1.0, 3)))
    mounted = SegmentCalibration(mount, np.zeros(3), GRAVITY + 0.3, "declared", 1.0)
    moved, valid = rng.normal(0.0, 3.0, (N, 3)), rng.random(N) > 0.1
    world = moved + np.array([0.0, 0.0, GRAVITY])
    inverse = q * np.array([1.0, -1.0, -1.0, -1.0])
    acc = (rotate(inverse, world) + np.array([0.0, 0.3, 0.0])) @ mount
    result = remove_gravity(acc, valid, q, mounted)
    np.testing.assert_allclose(result[valid], moved[valid], atol=1e-12)
    np.testing.assert_array_equal(result[~valid], 0.0)


def all_known(valid: list[Bools], step: Bools) -> Bools:
    """Whole-take form: every sensor there, and each foot has rested since it was lost."""
    index = np.arange(len(step))
    reference = np.logical_and.reduce(valid)
    for leg, target in enumerate(valid[-2:]):
        lost = np.maximum.accumulate(np.where(target, -1, index))
        rested = np.maximum.accumulate(np.where(target & step[:, leg], index, -1))
        reference &= rested >= lost
    return np.asarray(reference)


@pytest.mark.parametrize("bodies", [2, 3])
def test_after_a_loss_a_foot_is_known_from_its_next_rest_on_however_the_samples_come(bodies: int) -> None:
    rng = np.random.default_rng(bodies)
    valid = [np.repeat(rng.random(N // 10) > 0.2, 10) for _ in range(bodies)]
    step = np.repeat(rng.random((N // 5, 2)) > 0.6, 5, axis=0)
    whole = KnownSamples().push(valid, step)
    np.testing.assert_array_equal(whole, all_known(valid, step))
    assert 0 < whole.sum() < N
    watch, edges = KnownSamples(), [0, 1, 7, 7, 120, 121, N]
    parts = [watch.push([v[a:b] for v in valid], step[a:b]) for a, b in pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
