"""The ErKF's first state: what is known when a take starts standing, mid-walk, or has no rest at all."""

from __future__ import annotations

from itertools import pairwise
from math import degrees

import numpy as np
import pytest

from sagittal.core.body.erkf.filter import ErkfInputs
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.smoother import smooth
from sagittal.core.body.erkf.start import chain_positions, start_state
from sagittal.core.body.tree import PRESETS, ImuTree
from sagittal.core.frames import Floats
from sagittal.core.rotation import multiply, rotate
from tests.core.body.erkf.walks import SEGMENTS, Take, mixed_walk

OFFLINE = ErkfParams.offline()
MID_WALK_S = 10.0
FEET = [SEGMENTS.index("foot_r"), SEGMENTS.index("foot_l")]


def bias_sd_deg(P: Floats) -> float:
    """Uncertainty of the first sensor's gyroscope bias, °/s."""
    return degrees(float(np.sqrt(P[9, 9])))


def feet_from_mid_walk(take: Take) -> tuple[ImuTree, ErkfInputs]:
    """Both feet, unlinked, from mid-walk to the last standing: a take whose only rest is at its end."""
    tree = ImuTree(
        imus=("foot_r", "foot_l"), joints=(), feet=(0, 1),
        q_mount=take.tree.q_mount[FEET], place=take.tree.place[FEET], origin=take.tree.origin[FEET],
    )  # fmt: skip
    x = take.inputs.part(round(MID_WALK_S * take.rate_hz), len(take.inputs.step_s))
    return tree, ErkfInputs(
        x.step_s, x.acc[:, FEET], x.gyr[:, FEET], x.valid[:, FEET], x.contact[:, FEET], x.still[:, FEET]
    )


def test_a_standing_start_knows_tilt_velocity_and_bias() -> None:
    take = mixed_walk()
    P = start_state(take.tree, take.inputs, OFFLINE, take.rest).P
    assert np.isclose(bias_sd_deg(P), 0.05)
    assert np.isclose(np.sqrt(P[3, 3]), OFFLINE.start_velocity_sd)


def test_a_bias_seen_at_a_later_rest_has_only_walked_since() -> None:
    """hypot(0.05 °/s, 5e-5 rad/s/√s √t): 0.053 °/s after 38 s, 0.09 after 10 min, not the 0.2 of no rest."""
    take = mixed_walk()
    after_s = {s: start_state(take.tree, take.inputs, OFFLINE, bias_age_s=s) for s in (0.0, 38.0, 600.0)}
    assert np.allclose([bias_sd_deg(x.P) for x in after_s.values()], [0.05, 0.0530, 0.0861], atol=2e-4)
    assert np.isclose(bias_sd_deg(start_state(take.tree, take.inputs, OFFLINE).P), 0.2)
    moving = after_s[38.0].P
    assert np.isclose(np.sqrt(moving[3, 3]), OFFLINE.moving_velocity_sd), "velocity stays unknown"


def test_the_age_of_the_bias_does_not_matter_to_a_standing_start() -> None:
    take = mixed_walk()
    without, with_age = (
        start_state(take.tree, take.inputs, OFFLINE, take.rest, bias_age_s=s) for s in (None, 600.0)
    )
    np.testing.assert_array_equal(without.P, with_age.P)


def test_joint_centres_coincide_and_the_lower_foot_is_at_ankle_height() -> None:
    take = mixed_walk()
    k = round(MID_WALK_S * take.rate_hz)
    q = np.stack([multiply(take.truth.q[s][k], take.tree.q_mount[i]) for i, s in enumerate(SEGMENTS)])
    p = chain_positions(take.tree, q)
    for joint in take.tree.joints:
        ends = [
            p[i] + rotate(q[i], r)
            for i, r in ((joint.proximal, joint.r_proximal), (joint.distal, joint.r_distal))
        ]
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)
    ankles = take.tree.segment_origin(p, q)[FEET, 2]
    assert np.isclose(ankles.min(), take.tree.origin[FEET[0], 2])


@pytest.mark.slow
def test_two_feet_from_mid_walk_to_a_standing_end_keep_their_strides() -> None:
    """Known biases give the strides of a standing start (docs/science/erkf.md: |bias| < 5, RMS < 6 mm)."""
    take = mixed_walk()
    tree, inputs = feet_from_mid_walk(take)
    track, _ = smooth(start_state(tree, inputs, OFFLINE, bias_age_s=50.0), inputs, tree, OFFLINE)
    ankle = tree.segment_origin(track.p, track.q)
    first = round(MID_WALK_S * take.rate_hz)
    for i, segment in enumerate(PRESETS["feet2"]):
        still = np.flatnonzero(np.diff(inputs.contact[:, i].astype(int)) > 0) + 5
        true = take.truth.p[segment][first:]
        error = [
            np.linalg.norm((ankle[b, i] - ankle[a, i])[:2]) - np.linalg.norm((true[b] - true[a])[:2])
            for a, b in pairwise(still)
        ]
        assert len(error) > 10
        assert abs(np.mean(error)) < 0.005
        assert np.sqrt(np.mean(np.square(error))) < 0.006
