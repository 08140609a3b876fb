"""ErKF invariances, faults within a trial, and impossible set-ups."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.body.erkf.filter import ErkfInputs, erkf_inputs, filter_block
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.tree import ImuTree, Joint, person_tree
from sagittal.core.errors import EstimationError, ParameterError, SignalError
from sagittal.core.frames import Floats
from sagittal.core.rotation import conjugate, multiply, normalise, rotate, to_matrix
from tests.core.body.erkf.walks import (
    SEGMENTS,
    Take,
    angle_errors_deg,
    filtered,
    lost,
    mixed_walk,
    smoothed,
    stride_errors_m,
)

LIVE, OFFLINE = ErkfParams.live(), ErkfParams.offline()


def shuffled(take: Take, order: list[int]) -> Take:
    """Sensors and joints in another order."""
    t, x, position = take.tree, take.inputs, {old: new for new, old in enumerate(order)}
    joints = tuple(
        replace(j, proximal=position[j.proximal], distal=position[j.distal]) for j in reversed(t.joints)
    )
    tree = ImuTree(
        tuple(t.imus[i] for i in order), joints, tuple(position[i] for i in t.feet),
        t.q_mount[order], t.place[order], t.origin[order],
    )  # fmt: skip
    flags = (x.valid[:, order], x.contact[:, order], x.still[:, order])
    return replace(take, tree=tree, inputs=ErkfInputs(x.step_s, x.acc[:, order], x.gyr[:, order], *flags))


def remounted(take: Take, key: Floats) -> Take:
    """Every sensor turned on its segment by a rotation (n, 4)."""
    t, x = take.tree, take.inputs

    def end(i: int, r: Floats) -> Floats:
        return np.asarray(rotate(key[i], r))

    joints = [
        replace(
            j,
            r_proximal=end(j.proximal, j.r_proximal),
            r_distal=end(j.distal, j.r_distal),
            e_proximal=None if j.e_proximal is None else end(j.proximal, j.e_proximal),
            e_distal=None if j.e_distal is None else end(j.distal, j.e_distal),
        )
        for j in t.joints
    ]
    tree = replace(t, joints=tuple(joints), q_mount=multiply(t.q_mount, conjugate(key)))
    return replace(take, tree=tree, inputs=replace(x, acc=rotate(key, x.acc), gyr=rotate(key, x.gyr)))


@pytest.mark.slow
def test_the_order_of_sensors_and_joints_does_not_matter() -> None:
    take = mixed_walk()
    order = [4, 0, 6, 2, 1, 5, 3]
    one, second = filtered(take, OFFLINE), filtered(shuffled(take, order), OFFLINE)
    np.testing.assert_allclose(second.nominal, one.nominal[:, order], atol=1e-10)
    assert np.array_equal(second.refused, one.refused[:, order])


def test_how_a_sensor_is_turned_on_its_segment_does_not_matter() -> None:
    take = mixed_walk()
    by_key = normalise(np.random.default_rng(7).normal(size=(len(SEGMENTS), 4)))
    repeat = remounted(take, by_key)
    params = replace(OFFLINE, joint_axis_sd=0.2)
    one, second = filtered(take, params), filtered(repeat, params)
    np.testing.assert_allclose(second.p, one.p, atol=1e-10)
    a, b = take.tree.segment_q(one.q), repeat.tree.segment_q(second.q)
    assert np.abs(np.abs(np.sum(a * b, axis=-1)) - 1.0).max() < 1e-12


def test_three_percent_of_lost_packets_cost_little() -> None:
    """At random over all sensors, held and marked; limits of
    docs/science/erkf.md, "Limits on simulated walks"."""
    take, rng = mixed_walk(), np.random.default_rng(3)
    gone = rng.random(take.inputs.valid.shape) < 0.03
    gone[: round(take.truth.zero[1] * take.rate_hz)] = False
    acc, gyr = take.inputs.acc.copy(), take.inputs.gyr.copy()
    acc[gone] = gyr[gone] = np.nan
    holes = replace(take, inputs=erkf_inputs(take.tree, acc, gyr, ~gone, take.rate_hz))
    assert 0.02 < 1.0 - holes.inputs.valid.mean() < 0.04
    track = smoothed(holes, replace(OFFLINE, gyr_sd_of={}))
    errors = angle_errors_deg(holes, track)
    for name, limit in (
        ("hip_flexion", 0.3),
        ("knee_flexion", 0.3),
        ("ankle_dorsiflexion", 0.3),
        ("hip_rotation", 1.0),
    ):
        assert max(errors[f"{name}_{e}"] for e in "lr") < limit, name
    assert np.sqrt(np.mean(stride_errors_m(holes, track) ** 2)) < 0.006


def test_samples_that_all_sensors_lack_are_stepped_over_by_their_time() -> None:
    """A tenth of the instants taken out: the step's own Δt counts, not the rate
    (docs/science/erkf.md, "Prediction")."""
    take, rng, x = mixed_walk(), np.random.default_rng(4), mixed_walk().inputs
    stored_indices = np.flatnonzero((rng.random(len(x.step_s)) > 0.1) | (np.arange(len(x.step_s)) < 500))
    step = np.diff(np.cumsum(x.step_s)[stored_indices], prepend=0.0)
    assert step.max() > 0.025
    flags = (x.valid[stored_indices], x.contact[stored_indices], x.still[stored_indices])

    def against_pelvis(q: Floats) -> Floats:
        return np.asarray(multiply(conjugate(q[:, :1]), q))

    def off_deg(step_s: Floats) -> float:
        thinned = replace(
            take, inputs=ErkfInputs(step_s, x.acc[stored_indices], x.gyr[stored_indices], *flags)
        )
        result, whole = (take.tree.segment_q(t.q) for t in (filtered(thinned, LIVE), filtered(take, LIVE)))
        same = np.abs(np.sum(against_pelvis(result) * against_pelvis(whole[stored_indices]), axis=-1))
        return float(np.degrees(np.sqrt(np.mean((2.0 * np.arccos(np.clip(same[1000:], 0.0, 1.0))) ** 2))))

    assert off_deg(step) < 1.0
    assert off_deg(np.where(step > 0.0, 1.0 / take.rate_hz, 0.0)) > 5.0, "what a fixed rate would do"


def test_false_contacts_are_refused_and_cost_little() -> None:
    take = mixed_walk()
    rng = np.random.default_rng(5)
    contact = take.inputs.contact.copy()
    for i in take.tree.feet:
        swing = np.flatnonzero(~contact[:, i])
        contact[rng.choice(swing, len(swing) // 40, replace=False), i] = True
    spoilt = replace(take, inputs=replace(take.inputs, contact=contact))
    gated = filtered(spoilt, LIVE)
    assert gated.refused.sum() > 20
    assert abs(stride_errors_m(spoilt, gated).mean()) < 0.008
    ungated = filtered(spoilt, replace(LIVE, gate=None))
    assert abs(stride_errors_m(spoilt, ungated).mean()) > 3 * abs(stride_errors_m(spoilt, gated).mean())


@pytest.mark.parametrize(("wider", "most_m"), [(3, 0.006), (5, 0.018)])
def test_contacts_that_begin_early_and_end_late_shorten_strides_by_millimetres(
    wider: int, most_m: float
) -> None:
    """30 and 50 ms at both ends: −5 and −14 mm of 1280. The gate does not help here: after an impact its rule
    leaves the velocity so uncertain that a foot at the end of its swing passes as still."""
    take = mixed_walk()
    contact = take.inputs.contact.copy()
    for i in take.tree.feet:
        contact[:, i] = np.convolve(contact[:, i], np.ones(2 * wider + 1), "same") > 0.0
    spoilt = replace(take, inputs=replace(take.inputs, contact=contact))
    result = stride_errors_m(spoilt, filtered(spoilt, LIVE))
    assert abs(result.mean()) < most_m
    assert np.sqrt(np.mean(result**2)) < 1.2 * most_m


@pytest.mark.slow
@pytest.mark.parametrize(
    ("segment", "angle"), [("foot_l", "ankle_dorsiflexion_l"), ("shank_r", "knee_flexion_r")]
)
def test_a_lost_sensor_is_predicted_and_comes_back(segment: str, angle: str) -> None:
    take = lost(mixed_walk(), segment, 15.0, 15.3)  # type: ignore[arg-type]
    track = smoothed(take, OFFLINE)
    assert np.isfinite(track.p).all()
    assert np.isfinite(track.q).all()
    errors = angle_errors_deg(take, track)
    assert errors[angle] < 3.0
    assert errors["knee_flexion_l"] < 0.5


def test_an_unnoticed_gap_of_a_foot_is_taken_up_again() -> None:
    """Held samples that nobody marks: re-acceptance keeps the path within metres, not hundreds
    (docs/science/erkf.md, "Zero velocity")."""
    take = lost(mixed_walk(), "foot_l", 15.0, 15.3)
    still = mixed_walk().inputs
    unnoticed = replace(take, inputs=replace(take.inputs, valid=still.valid, contact=still.contact))
    track = filtered(unnoticed, LIVE)
    assert np.isfinite(track.nominal).all()
    foot = SEGMENTS.index("foot_l")
    assert np.linalg.norm(track.p[-1, foot] - filtered(mixed_walk(), LIVE).p[-1, foot]) < 10.0


@pytest.mark.sweep
@pytest.mark.parametrize("params", [LIVE, OFFLINE], ids=["live", "offline"])
def test_ten_minutes_keep_the_covariance_symmetric_and_positive(params: ErkfParams) -> None:
    """60 000 steps; a row and a column pass that are not mirrored would be 2e-5 apart by then."""
    take = mixed_walk()
    state, steps = start_state(take.tree, take.inputs, params, take.rest), 0
    while steps < 60_000:
        _, state = filter_block(state, take.inputs, take.tree, params)
        steps += len(take.inputs.step_s)
        assert np.linalg.eigvalsh(state.P)[0] > 0.0
    assert np.abs(state.P - state.P.T).max() / np.abs(state.P).max() < 1e-15


def broken(make: str) -> None:
    """Do what its name says."""
    take = mixed_walk()
    tree, body = take.tree, take.truth.body
    mounts = {s: to_matrix(take.truth.mounts[s].q_segment_sensor) for s in SEGMENTS}
    first, ten = start_state(tree, take.inputs, LIVE, take.rest), take.inputs.part(0, 10)
    loop = Joint("again", 0, 3, np.zeros(3), np.zeros(3))
    infinite = first.P.copy()
    infinite[0, 0] = np.inf
    nan = np.full_like(ten.acc, np.nan)
    match make:
        case "one sensor for seven bodies":
            person_tree(body, {"pelvis": mounts["pelvis"]}, SEGMENTS)
        case "a thigh without length":
            person_tree(replace(body, thigh=0.0), mounts, SEGMENTS)
        case "a shank in millimetres":
            person_tree(replace(body, shank=430.0), mounts, SEGMENTS)
        case "two sensors on one foot":
            person_tree(body, mounts, ("foot_l", "foot_l"))
        case "no sensor":
            ImuTree((), (), (), np.zeros((0, 4)), np.zeros((0, 3)), np.zeros((0, 3)))
        case "a joint too many":
            replace(tree, joints=(*tree.joints, loop))
        case "a joint to nowhere":
            replace(tree, joints=(replace(tree.joints[0], distal=9),))
        case "a hinge with one axis":
            replace(tree, joints=(replace(tree.joints[0], e_proximal=np.ones(3), e_distal=None),))
        case "a covariance that is negative":
            filter_block(replace(first, P=-first.P), ten, tree, LIVE)
        case "a covariance that is infinite":
            filter_block(replace(first, P=infinite), ten, tree, LIVE)
        case "nine states where fifteen are meant":
            filter_block(first, ten, tree, OFFLINE)
        case "samples that are no numbers":
            filter_block(first, replace(ten, acc=nan), tree, LIVE)
        case "a sensor that never measured":
            erkf_inputs(tree, nan, ten.gyr, ten.valid, take.rate_hz)
        case "time that runs back":
            filter_block(first, replace(ten, step_s=-ten.step_s), tree, LIVE)
        case "a thigh that stands":
            thigh = tree.imus.index("thigh_l") == np.arange(len(tree.imus))
            filter_block(first, replace(ten, contact=np.tile(thigh, (10, 1))), tree, LIVE)
        case "joints without uncertainty":
            ErkfParams(joint_centre_sd=0.0)


@pytest.mark.parametrize(
    ("make", "error", "code"),
    [
        ("one sensor for seven bodies", EstimationError, "segments_missing"),
        ("a thigh without length", EstimationError, "segment_length"),
        ("a shank in millimetres", EstimationError, "segment_length"),
        ("two sensors on one foot", EstimationError, "duplicate_segment"),
        ("no sensor", EstimationError, "no_imu"),
        ("a joint too many", EstimationError, "joint_loop"),
        ("a joint to nowhere", EstimationError, "joint_unknown"),
        ("a hinge with one axis", ParameterError, "bad_joint"),
        ("a covariance that is negative", EstimationError, "filter_diverged"),
        ("a covariance that is infinite", EstimationError, "filter_diverged"),
        ("nine states where fifteen are meant", ParameterError, "bad_shape"),
        ("samples that are no numbers", SignalError, "bad_signal"),
        ("a sensor that never measured", SignalError, "bad_signal"),
        ("time that runs back", ParameterError, "bad_step"),
        ("a thigh that stands", ParameterError, "bad_contact"),
        ("joints without uncertainty", ParameterError, "deviation_range"),
    ],
)
def test_set_ups_that_cannot_work_are_named(make: str, error: type[Exception], code: str) -> None:
    with pytest.raises(error) as refused:
        broken(make)
    assert refused.value.code == code  # type: ignore[attr-defined]


def test_a_covariance_that_breaks_on_the_way_says_when() -> None:
    """Accelerations a thousand times too large, as in other units, drive the state beyond any place."""
    take = mixed_walk()
    first = start_state(take.tree, take.inputs, LIVE, take.rest)
    huge = replace(take.inputs, acc=1e9 * take.inputs.acc)
    with pytest.raises(
        EstimationError, match=r"no longer positive definite \d+\.\d+ s into this block; check units"
    ) as caught:
        filter_block(first, huge, take.tree, LIVE)
    assert caught.value.code == "filter_diverged"
