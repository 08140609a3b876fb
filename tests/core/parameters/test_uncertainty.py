"""Value ± uncertainty: what many strides make smaller and what they do not, and where each part counts."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, sqrt

import numpy as np
import pytest

from sagittal.core.change import parameter_changes
from sagittal.core.events.result import EventKind, GaitEvent, GaitEvents, Stride, Strides
from sagittal.core.frames import SIDES, Side
from sagittal.core.norms.place import place_value
from sagittal.core.norms.values import NormValue
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.symmetry import compare_sides
from sagittal.core.parameters.temporal import summarise_times
from sagittal.core.parameters.uncertainty import (
    PITCH_RULE,
    REFINED,
    TYPICAL_S,
    ContactErrors,
    state_uncertainty,
)
from sagittal.core.parameters.variability import summarise_values

STRIDE_S, STANCE_S = 1.1, 0.69
KINDS: tuple[EventKind, EventKind] = ("ic", "tc")


def figure(name: str, mean: float, sd: float, n: int, side: Side | None = "left") -> Parameter:
    spread = sd * np.resize([-1.0, 1.0], n) * sqrt((n - 1) / n)
    return summarise_values(name, side, (mean + spread).tolist(), CATALOGUE[name].unit)


def stated(*found: Parameter, events: GaitEvents | None = None) -> dict[str, Parameter]:
    return {p.name: p for p in state_uncertainty(found, events)}


def told(uncertainty_s: float) -> GaitEvents:
    return GaitEvents(
        tuple(
            GaitEvent(float(i), side, kind, "any", float(i), uncertainty_s=uncertainty_s)
            for i in range(8)
            for side in SIDES
            for kind in KINDS
        )
    )


def test_many_strides_lessen_the_random_part_alone() -> None:
    few, many = (stated(figure("step_length_m", 0.6, 0.03, n))["step_length_m"] for n in (6, 6000))
    assert few.uncertainty is not None
    assert many.uncertainty is not None
    errors = CATALOGUE["step_length_m"].errors
    assert errors is not None
    floor = 1.96 * hypot(errors.own, errors.common)
    assert many.uncertainty == pytest.approx(floor, rel=0.01)
    assert few.uncertainty > 1.3 * floor
    assert few.uncertainty == pytest.approx(hypot(2.571 * 0.03 / sqrt(6), floor), rel=0.001)


def test_strides_that_happen_to_be_alike_do_not_hide_the_error_of_one() -> None:
    alike = stated(figure("stride_length_m", 1.2, 0.0, 2))["stride_length_m"]
    assert alike.uncertainty is not None
    assert alike.uncertainty > 1.96 * 0.017 / sqrt(2)


def test_one_stride_has_the_errors_of_measurement_and_no_whole() -> None:
    """It would be said to be known better than two, whose spread is seen."""
    two = stated(figure("stride_length_m", 1.2, 0.03, 2))["stride_length_m"]
    one = stated(replace(two, n=1, sd=None, uncertainty=None))["stride_length_m"]
    assert one.uncertainty is None
    assert (one.u_own, one.u_common) == (two.u_own, two.u_common)


@pytest.mark.parametrize("errors", [PITCH_RULE, REFINED])
def test_a_time_is_known_as_the_events_at_its_ends_are(errors: ContactErrors) -> None:
    """Stance is foot-off minus contact: the errors of both rules add; between contacts they fall out."""
    names = ("stride_time_s", "step_time_s", "stance_time_s", "swing_time_s", "double_support_s")
    events = None if errors is PITCH_RULE else told(TYPICAL_S)
    found = stated(*(figure(name, 1.0, 0.02, 20) for name in names), events=events)
    both = hypot(errors.contact, errors.foot_off)
    common = {name: found[name].u_common for name in names}
    assert common["stride_time_s"] == common["step_time_s"] == pytest.approx(0.0, abs=1e-12)
    assert common["stance_time_s"] == common["swing_time_s"] == pytest.approx(both)
    assert common["double_support_s"] == pytest.approx(2.0 * both), "a sum of two such times"
    own = {name: found[name].u_own for name in names}
    assert own["stride_time_s"] == pytest.approx(0.0, abs=1e-12)
    assert own["step_time_s"] == own["stance_time_s"] == pytest.approx(sqrt(2.0) * errors.foot)
    assert own["double_support_s"] == pytest.approx(2.0 * errors.foot)


def test_a_share_is_known_as_its_time_and_events_that_are_vaguer_make_it_vaguer() -> None:
    stride = figure("stride_time_s", STRIDE_S, 0.02, 20)
    share, time = figure("stance_pct", 63.0, 1.0, 20), figure("stance_time_s", 0.69, 0.01, 20)
    sharp, vague = (stated(stride, share, time, events=told(s)) for s in (TYPICAL_S, 3.0 * TYPICAL_S))
    for found, scale in ((sharp, 1.0), (vague, 3.0)):
        assert found["stance_time_s"].u_common == pytest.approx(
            scale * hypot(REFINED.contact, REFINED.foot_off)
        )
        assert found["stance_pct"].u_common == pytest.approx(
            100.0 * (found["stance_time_s"].u_common or 0.0) / STRIDE_S
        )
    assert stated(share)["stance_pct"].uncertainty is None, "a share of a stride of unknown length"


def test_what_is_not_declared_is_not_stated() -> None:
    plain = figure("loading_pct", 12.0, 1.0, 20)
    assert stated(plain)["loading_pct"] == plain
    absent = Parameter("step_length_m", "left", 0, None, None, "m", "no_strides")
    assert stated(absent)["step_length_m"] == absent


def test_angles_without_two_sensors_and_levels_of_a_goniometer_are_known_less_well() -> None:
    knee = figure("knee_flexion_max_swing_deg", 55.0, 2.0, 20)
    (measured,) = state_uncertainty([knee])
    (modelled,) = state_uncertainty([knee], estimated=("knee_flexion_l",))
    (feet_alone,) = state_uncertainty([knee], estimated=("knee_flexion_l", "pelvis_tilt"))
    (other,) = state_uncertainty([knee], estimated=("knee_flexion_r",))
    (level,) = state_uncertainty([knee], goniometer=True)
    assert other == measured, "the sensors of a side say nothing less because one of the other has failed"
    assert (measured.u_own, modelled.u_own, feet_alone.u_own) == (2.0, 10.5, 11.0)
    assert level.u_own == pytest.approx(hypot(2.0, 3.0))


def test_sides_differ_only_beyond_what_each_is_known_to() -> None:
    """Two knees 5° apart, with strides that are steady: mounting alone may do that."""
    left = figure("knee_flexion_max_swing_deg", 55.0, 1.0, 30, "left")
    right = figure("knee_flexion_max_swing_deg", 50.0, 1.0, 30, "right")
    (before,) = compare_sides([left, right])
    assert before.clear
    (after,) = compare_sides(state_uncertainty([left, right]))
    assert not after.clear
    far = replace(right, mean=45.0)
    (clear,) = compare_sides(state_uncertainty([left, far]))
    assert clear.clear
    # a definition that both sides share does not blur their difference
    times = [
        figure("stance_time_s", 0.70, 0.01, 30, "left"),
        figure("stance_time_s", 0.65, 0.01, 30, "right"),
    ]
    (stance,) = compare_sides(state_uncertainty(times, told(TYPICAL_S)))
    assert stance.clear


def test_a_change_is_said_only_beyond_what_two_takes_measure_anew() -> None:
    old, new = (figure("ankle_dorsiflexion_min_deg", x, 0.5, 40) for x in (-10.0, -16.0))
    (bare,) = parameter_changes([old], [new])
    (found,) = parameter_changes(state_uncertainty([old]), state_uncertainty([new]))
    assert bare.limit is not None
    assert found.limit is not None
    assert found.limit >= max(bare.limit, 1.96 * sqrt(2.0) * 1.5)
    short, long = (figure("step_length_m", x, 0.001, 40) for x in (0.50, 0.525))
    (small,) = parameter_changes([short], [long])
    (known,) = parameter_changes(state_uncertainty([short]), state_uncertainty([long]))
    assert known.limit is not None
    assert known.limit >= (small.limit or 0.0)
    assert known.verdict == "within_measurement_error"


def test_a_norm_is_left_only_beyond_the_uncertainty() -> None:
    norm = NormValue("knee_flexion_rom_deg", 65.0, 4.0, 42, "g", "s")
    assert place_value(57.0, norm).grade == 1
    near = place_value(57.0, norm, uncertainty=3.0)
    assert near.z == pytest.approx(-2.0)
    assert near.grade == 0
    assert place_value(50.0, norm, uncertainty=3.0).grade == 1


def walk(rng: np.random.Generator, n: int) -> tuple[tuple[Parameter, ...], GaitEvents]:
    """A take whose events have the errors that `REFINED` describes; both legs alike, stance 0.69 of 1.1 s."""
    lengths = STRIDE_S + 0.03 * rng.standard_normal(n + 2)
    starts = np.cumsum(lengths)
    ic_bias, tc_bias = rng.normal(0.0, (REFINED.contact, REFINED.foot_off))
    events, times = [], {}
    for k, side in enumerate(SIDES):
        ic = starts + 0.5 * k * STRIDE_S
        tc = ic + STANCE_S + 0.012 * rng.standard_normal(len(ic))
        of_foot = rng.normal(0.0, REFINED.foot, 2)
        ic = ic + ic_bias + of_foot[0] + rng.normal(0.0, REFINED.random, len(ic))
        tc = tc + tc_bias + of_foot[1] + rng.normal(0.0, REFINED.random, len(tc))
        times[side] = ic, tc
        for kind, found in zip(KINDS, (ic, tc), strict=True):
            events += [
                GaitEvent(float(t), side, kind, "any", float(t), uncertainty_s=TYPICAL_S) for t in found
            ]
    (ic, tc), (other_ic, other_tc) = times["left"], times["right"]
    strides = []
    for i in range(1, n):
        strides.append(Stride("left", ic[i], tc[i], ic[i + 1], float(other_tc[i - 1]), float(other_ic[i])))
        strides.append(
            Stride("right", other_ic[i], other_tc[i], other_ic[i + 1], float(tc[i]), float(ic[i + 1]))
        )
    found = GaitEvents(tuple(events))
    return state_uncertainty(summarise_times(Strides(tuple(strides))), found), found


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 25])
def test_the_truth_lies_within_as_often_as_said(n: int) -> None:
    """300 takes with errors drawn as declared: 95 % of the values ± hold the truth, of 6 strides as of 25."""
    rng = np.random.default_rng(3)
    true = {"stride_time_s": STRIDE_S, "stance_time_s": STANCE_S, "swing_time_s": STRIDE_S - STANCE_S}
    true |= {"double_support_s": 2.0 * STANCE_S - STRIDE_S, "step_time_s": 0.5 * STRIDE_S}
    true |= {"stance_pct": 100.0 * STANCE_S / STRIDE_S}
    inside: dict[str, list[bool]] = {name: [] for name in true}
    widths: dict[str, list[float]] = {name: [] for name in true}
    for _ in range(300):
        for p in walk(rng, n)[0]:
            if p.name in true:
                assert p.mean is not None
                assert p.uncertainty is not None
                inside[p.name].append(abs(p.mean - true[p.name]) <= p.uncertainty)
                widths[p.name].append(p.uncertainty)
    for name, found in inside.items():
        assert np.mean(found) >= 0.93, (name, np.mean(found))
    # and it is not said by saying little
    assert np.mean(widths["stance_time_s"]) < 0.053
    assert np.mean(widths["stance_pct"]) < 5.0


def test_a_clock_that_may_be_late_makes_sides_no_clear_difference() -> None:
    """One clock 60 ms late makes of steps of 0.55 s 0.49 and 0.61; swing and stride know nothing of it."""
    names = ("step_time_s", "initial_double_support_s", "swing_time_s", "stride_time_s", "double_support_s")
    values = [figure(name, 0.55, 0.01, 20, side) for name in names for side in SIDES]
    sure, doubtful = (
        {(p.name, p.side): p for p in state_uncertainty(values, told(TYPICAL_S), feet_lag_s=lag)}
        for lag in (0.0, 0.06)
    )
    for name in names:
        a, b = sure[name, "left"].u_own, doubtful[name, "left"].u_own
        assert a is not None
        expected = hypot(a, 0.06) if name in ("step_time_s", "initial_double_support_s") else a
        assert b == pytest.approx(expected), name
    steps = [
        replace(doubtful["step_time_s", side], mean=mean)
        for side, mean in zip(SIDES, (0.49, 0.61), strict=True)
    ]
    (compared,) = compare_sides(steps)
    assert not compared.clear
