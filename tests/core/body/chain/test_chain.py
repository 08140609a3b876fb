from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import pi, radians

import numpy as np
import pytest

from sagittal.core.body.chain.filter import ChainFilter, ChainFilterParams
from sagittal.core.body.chain.geometry import LegGeometry, locate_hip
from sagittal.core.body.chain.kernel import ChainArrays, climb, make_scratch, predict_signals
from sagittal.core.body.chain.model import RevoluteChain, build_leg_chain
from sagittal.core.calibration.fixed_offset import make_fixed_mounts
from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import GRAVITY, SHANK, Floats, Side
from sagittal.core.rotation import about, exp, to_matrix
from sagittal.core.simulate import SquatSimulation
from sagittal.core.simulate.squat_chain import measure_leg
from tests.core.body.chain.squats import HEIGHT_M, run, split, squat_on, stack_signals, start_filter


@cache
def squats(side: Side = "right") -> SquatSimulation:
    return squat_on(side)


@cache
def leg(side: Side = "right") -> LegGeometry:
    return measure_leg(HEIGHT_M, side)


def arrays(chain: RevoluteChain) -> ChainArrays:
    first, bounded = np.array(chain.first, np.int64), np.array(chain.bounded, np.bool_)
    return ChainArrays(chain.axes, chain.offsets, first, chain.places, chain.mounts, chain.base, bounded)


def random_chain(rng: np.random.Generator) -> RevoluteChain:
    """Seven hinges about any axes, with ways between all of them."""
    axes = rng.standard_normal((7, 3))
    return RevoluteChain(
        axes / np.linalg.norm(axes, axis=1)[:, None],
        rng.uniform(-0.4, 0.4, (7, 3)),
        (0, 3, 4, 7),
        rng.uniform(-0.3, 0.3, (3, 3)),
        to_matrix(exp(rng.standard_normal((3, 3)))),
        to_matrix(exp(rng.standard_normal(3))),
        (False,) * 7,
        np.ones(7),
    )


def signals_at(chain: RevoluteChain, i: int, x: Floats, derive: bool = False) -> tuple[Floats, Floats]:
    """What sensor i reads (6,) in the state x (7, 3), and the derivatives (6, n) by its own group."""
    s, inputs = make_scratch(9), arrays(chain)
    duplicate, motion = np.zeros((6, 3)), np.zeros((6, 3))
    duplicate[:3] = chain.base
    for k in range(i + 1):
        n = 3 * (chain.first[k + 1] - chain.first[k]) if derive and k == i else 0
        climb(inputs, k, x, duplicate, motion, n, s)
        duplicate = motion.copy()
    predict_signals(motion, chain.places[i], chain.mounts[i], n, s)
    return s.h.copy(), s.H[:, :n].copy()


@pytest.mark.sweep
@pytest.mark.slow  # compiles for seconds a function by itself, of which a squat runs the whole
@pytest.mark.parametrize("i", [0, 1, 2])
def test_derivatives_are_those_of_differences(i: int) -> None:
    rng = np.random.default_rng(i)
    chain, x = random_chain(rng), rng.standard_normal((7, 3))
    _, H = signals_at(chain, i, x, derive=True)
    step = 1e-6
    for k in range(H.shape[1]):
        j, d = chain.first[i] + k // 3, k % 3
        ahead, duplicate = x.copy(), x.copy()
        ahead[j, d] += step
        duplicate[j, d] -= step
        slope = (signals_at(chain, i, ahead)[0] - signals_at(chain, i, duplicate)[0]) / (2.0 * step)
        assert H[:, k] == pytest.approx(slope, abs=2e-8 * max(1.0, np.abs(slope).max()))


@pytest.mark.slow  # as above
@pytest.mark.parametrize("i", [0, 1, 2])
def test_signals_are_those_of_the_differentiated_way(i: int) -> None:
    """By differences of the sensor's orientation and place, which know nothing of recursion."""
    rng = np.random.default_rng(10 + i)
    chain, x = random_chain(rng), 0.7 * rng.standard_normal((7, 3))

    def pose(t: float) -> tuple[Floats, Floats]:
        R, p = chain.base, np.zeros(3)
        for j in range(chain.first[i + 1]):
            p = p + R @ chain.offsets[j]
            R = R @ to_matrix(exp((x[j, 0] + x[j, 1] * t + 0.5 * x[j, 2] * t * t) * chain.axes[j]))
        return R @ chain.mounts[i], p + R @ chain.places[i]

    h = 1e-4
    (R0, p0), (R, p), (R1, p1) = pose(-h), pose(0.0), pose(h)
    turned = R.T @ (R1 - R0) / (2.0 * h)
    force = R.T @ ((p1 - 2.0 * p + p0) / h**2 + [0.0, 0.0, GRAVITY])
    expected = [turned[2, 1], turned[0, 2], turned[1, 0], *force]
    assert signals_at(chain, i, x)[0] == pytest.approx(expected, abs=1e-5)


def test_the_leg_is_the_chain_of_denavit_and_hartenberg() -> None:
    """Frames 0 to 6 of Kianifar: z along the joints, links along x; the same places of knee and hip."""

    def dh(theta: float, a: float, alpha: float) -> Floats:
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        return np.array(
            [
                [c, -s * ca, s * sa, a * c],
                [s, c * ca, -c * sa, a * s],
                [0.0, sa, ca, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )

    geometry = leg()
    chain = build_leg_chain(geometry, make_fixed_mounts("right"))
    q = np.radians([7.0, -4.0, 25.0, -60.0, 40.0, 5.0, -8.0])
    links = [R[0] for R in chain.links(q[None])]
    # z of frame 0 up, of frame 1 forward, of frame 2 to the right; x of frame 3 up the shin
    T = np.eye(4)
    T[:3, :3] = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    T = T @ dh(q[0], 0.0, pi / 2) @ dh(q[1] + pi / 2, 0.0, -pi / 2)
    tibia = T @ dh(q[2], geometry.tibia, 0.0)
    thigh = tibia @ dh(q[3], geometry.thigh, 0.0)
    knee = links[0] @ chain.offsets[3]
    assert tibia[:3, 3] == pytest.approx(knee, abs=1e-12)
    assert thigh[:3, 3] == pytest.approx(knee + links[1] @ chain.offsets[4], abs=1e-12)


@pytest.mark.sweep
@pytest.mark.parametrize("side", ["right", "left"])
def test_a_squat_is_followed_within_half_a_degree(side: Side) -> None:
    errors = run(squats(side), leg(side))
    assert errors[:6].max() < 0.5
    assert errors[6] < 2.0


def test_a_turned_tibia_sensor_shows_in_adduction_and_a_tilted_one_in_flexion() -> None:
    result, geometry, segments = squats(), leg(), make_fixed_mounts("right")
    exact = run(result, geometry)
    rolled = {**segments, SHANK["right"]: to_matrix(about(1, radians(10.0))) @ segments[SHANK["right"]]}
    errors = run(result, geometry, rolled)
    assert errors[1] == pytest.approx(2.5, abs=0.8)
    tilted = {**segments, SHANK["right"]: to_matrix(about(2, radians(5.0))) @ segments[SHANK["right"]]}
    errors = run(result, geometry, tilted)
    assert 4.5 < errors[2] < 5.5
    assert 4.5 < errors[3] < 5.5
    assert np.abs(errors[4:] - exact[4:]).max() < 0.5


@pytest.mark.parametrize("name", ["tibia", "pelvis_width"])
def test_lengths_hardly_matter(name: str) -> None:
    longer = replace(leg(), **{name: 1.05 * getattr(leg(), name)})
    assert np.abs(run(squats(), longer) - run(squats(), leg())).max() < 0.1


def test_a_bias_turns_what_gravity_does_not_see() -> None:
    errors = run(squats(), leg(), bias_deg=0.3)
    assert errors[0] == pytest.approx(2.9, abs=0.4), "the ankle's rotation drifts"
    assert errors[1:6].max() < 0.7
    assert errors[6] < 2.0


@pytest.mark.parametrize("sizes", [(1,), (7, 1, 64), (333,)])
def test_any_split_into_blocks_gives_the_same_bits(sizes: tuple[int, ...]) -> None:
    gyr, acc = stack_signals(squats(), "right")
    gyr, acc = gyr[:600], acc[:600]
    valid = np.ones(gyr.shape[:2], bool)
    valid[250:290, 1] = False
    whole = start_filter(acc, 50.0, leg()).advance(gyr, acc, valid)
    live = start_filter(acc, 50.0, leg())
    blocks = [live.advance(gyr[b], acc[b], valid[b]) for b in split(len(gyr), sizes)]
    for name in ("angles", "rates", "sd"):
        assert np.array_equal(np.concatenate([getattr(b, name) for b in blocks]), getattr(whole, name))


def test_a_silent_sensor_makes_its_angles_uncertain_and_gravity_finds_the_way_back() -> None:
    gyr, acc = stack_signals(squats(), "right")
    valid = np.ones(gyr.shape[:2], bool)
    valid[300:400, 0] = False
    gyr[~valid] = acc[~valid] = np.nan
    motion = start_filter(acc, 50.0, leg()).advance(gyr, acc, valid)
    assert np.isfinite(motion.angles).all()
    whole = start_filter(acc, 50.0, leg()).advance(*stack_signals(squats(), "right"))
    assert np.degrees(motion.sd[399, :3]).min() > 50.0
    back = slice(700, None)
    assert np.degrees(np.abs(motion.angles[back] - whole.angles[back])[:, 1:4]).max() < 1.0
    assert np.degrees(motion.sd[back, 0]).min() > 20.0, "what turned about the vertical is not known"
    assert np.degrees(motion.sd[back, 1:4]).max() < 1.0


def test_the_start_is_the_pose_that_gravity_shows() -> None:
    chain = build_leg_chain(leg(), make_fixed_mounts("right"))
    q = np.radians([0.0, 6.0, 30.0, -40.0, 35.0, -8.0, 0.0])
    x = np.zeros((7, 3))
    x[:, 0] = q
    force = np.stack([signals_at(chain, i, x)[0][3:] for i in range(3)])
    start = ChainFilter(chain, 100.0, force)
    assert np.degrees(start._x[:, 0] - q) == pytest.approx(0.0, abs=0.2)


def test_harrington_in_metres() -> None:
    assert 1000.0 * locate_hip(0.240, 0.150, 0.900) == pytest.approx([-45.9, -81.5, 88.3], abs=1e-9)


def test_the_left_leg_is_the_mirror_image() -> None:
    right, left = (LegGeometry.from_height(1.7, side) for side in ("right", "left"))
    right, left = (replace(g, thigh_aside=0.01, tibia_aside=0.02, knee_inward=0.01) for g in (right, left))
    for name in (
        "tibia_sensor_from_ankle",
        "thigh_sensor_from_knee",
        "back_sensor_from_hip",
        "knee_from_ankle",
    ):
        assert getattr(left, name)() == pytest.approx(getattr(right, name)() * [1.0, 1.0, -1.0])
    assert right.tibia_sensor_from_ankle()[2] < 0.0, "the flat side of the shin is the inner one"
    assert right.estimated


@pytest.mark.parametrize(
    "wrong", [{"tibia": 0.0}, {"thigh": float("nan")}, {"pelvis_width": 240.0}, {"knee_forward": 3.0}]
)
def test_impossible_lengths_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ParameterError) as caught:
        replace(leg(), **wrong)  # type: ignore[arg-type]
    assert caught.value.code == "length_implausible"


def test_bad_input_is_refused() -> None:
    gyr, acc = stack_signals(squats(), "right")
    run_on = start_filter(acc, 50.0, leg())
    for gyr_in, acc_in, valid in (
        (gyr[:, :2], acc, None),
        (gyr, acc[:-1], None),
        (gyr, acc, np.ones(len(gyr), bool)),
    ):
        with pytest.raises(EstimationError) as caught:
            run_on.advance(gyr_in, acc_in, valid)
        assert caught.value.code == "bad_shape"
    with pytest.raises(EstimationError) as caught:
        run_on.advance(gyr * np.nan, acc)
    assert caught.value.code == "filter_diverged"
    with pytest.raises(EstimationError) as caught:
        run_on.advance(1e9 * gyr, acc)
    assert caught.value.code == "filter_diverged"
    with pytest.raises(ParameterError):
        ChainFilterParams(jerk=0.0)
    with pytest.raises(ParameterError):
        start_filter(acc[:, :2], 50.0, leg())
    with pytest.raises(EstimationError) as caught:
        build_leg_chain(leg(), {"pelvis": np.eye(3)})
    assert caught.value.code == "segments_missing"
    good = build_leg_chain(leg(), make_fixed_mounts("right"))
    for change in ({"first": (0, 3, 7)}, {"axes": 2.0 * good.axes}, {"base": np.eye(2)}):
        with pytest.raises(ParameterError):
            replace(good, **change)
