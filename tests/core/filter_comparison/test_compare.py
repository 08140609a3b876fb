"""A simulated take through several filters: identities, and the known truth as reference."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.errors import EstimationError, FormatError, ParameterError
from sagittal.core.filter_comparison import FilterComparison, FilterRequest, compare_filters
from sagittal.core.filter_comparison.reference import fit_frames
from sagittal.core.filter_comparison.spread import choose_samples
from sagittal.core.formats.orientation_table import OrientationTable
from sagittal.core.frames import Floats
from sagittal.core.rotation import about, angle_between, exp, multiply, normalise
from sagittal.core.simulate import WalkTruth
from tests.helpers.walks import analysed, simulated

pytestmark = pytest.mark.slow

LAG_S = -3.2
TURN = about(2, np.radians(4.0))


class Ticks:
    """Clock that advances by a second with each reading."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 1.0
        return self.now


def compare(
    *filters: str, magnetometer: bool = True, reference: OrientationTable | None = None
) -> FilterComparison:
    take = analysed("comfortable")
    assert take.strides is not None
    request = FilterRequest(filters, magnetometer)
    return compare_filters(take, take.strides, request, lambda *_: None, Ticks(), reference)


@cache
def two() -> FilterComparison:
    return compare("mahony_2008", "madgwick_2011_imu", "martin_2010", magnetometer=False)


def truth_table(truth: WalkTruth, error: Floats | None = None) -> OrientationTable:
    """The truth as another laboratory gives it: its own world, its own clusters, its own clock."""
    rng = np.random.default_rng(1)
    world = normalise(rng.standard_normal(4))
    q = {
        f"{s}_imu": multiply(multiply(world, q), normalise(rng.standard_normal(4)))
        for s, q in truth.q.items()
        if s in ("shank_l", "foot_l", "pelvis")
    }
    if error is not None:
        q = {s: multiply(x, error) for s, x in q.items()}
    return OrientationTable("truth.sto", truth.t_s + LAG_S, q)


@pytest.mark.sweep
def test_one_filter_alone_has_no_spread_and_is_its_own_median() -> None:
    comparison = compare("mahony_2008")
    assert all(np.nanmax(s.sd) < 1e-9 and np.nanmax(s.range) < 1e-9 for s in comparison.spreads)
    own, mahony = comparison.filters
    assert mahony.to_median is not None
    assert mahony.to_median.total < 1e-7
    # the product's own chain is another filter and a body model: near, not the same
    assert mahony.to_own is not None
    assert own.to_median is not None
    assert 0.0 < mahony.to_own.total < np.radians(4.0)


def test_two_filters_are_half_their_range_apart_and_the_phases_are_of_the_same_size() -> None:
    for s in two().spreads:
        known_finite = np.isfinite(s.sd)
        np.testing.assert_allclose(2.0 * s.sd[known_finite], s.range[known_finite], atol=1e-9)
        assert s.filters == 2
        assert set(s.cycle_sd) == (
            {"left"} if "_l" in s.name else {"right"} if "_r" in s.name else {"left", "right"}
        )
        for side, curve in s.cycle_sd.items():
            stance, swing = s.stance[side], s.swing[side]
            assert stance is not None
            assert swing is not None
            assert curve.shape == (101,)
            assert curve.min() <= max(stance, swing)
            assert min(stance, swing) <= curve.max()


def test_all_begin_where_the_analysis_stands() -> None:
    index = two().t_s < 2.0
    assert all(np.nanmax(s.range[index]) < np.radians(1.0) for s in two().spreads)


def test_what_needs_a_magnetometer_says_so_and_the_others_are_compared() -> None:
    refused = two().filters[-1]
    assert (refused.to_median, refused.cost_us) == (None, None)
    assert [n.code for n in refused.told] == ["no_magnetometer"]
    assert "Martin2010" in two().notices[0].message
    with pytest.raises(EstimationError, match="magnetometer") as caught:
        compare("martin_2010", magnetometer=False)
    assert caught.value.code == "no_filter_ran"


def test_cost_is_the_time_of_a_filter_by_sensor_and_sample() -> None:
    samples = len(analysed("comfortable").recording.t_s)
    assert two().filters[1].cost_us == pytest.approx(1e6 / samples)


@pytest.mark.parametrize(("filters", "code"), [((), "no_filter"), (("kalman_1960",), "no_such_algorithm")])
def test_what_is_no_filter_is_refused(filters: tuple[str, ...], code: str) -> None:
    with pytest.raises(ParameterError) as caught:
        compare(*filters)
    assert caught.value.code == code


def test_a_diverging_filter_is_told_and_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    from sagittal.core.filter_comparison import run

    whole = run._orient_by_published

    def break_down(name: str, x: run.MountedSignals, rate_hz: float) -> Floats:
        if name == "hua_2014":
            raise EstimationError("filter_diverged", "Hua2014 has diverged.")
        return whole(name, x, rate_hz)

    monkeypatch.setattr(run, "_orient_by_published", break_down)
    comparison = compare("mahony_2008", "hua_2014")
    assert [n.code for n in comparison.filters[-1].told] == ["filter_diverged"]
    assert {s.filters for s in comparison.spreads} == {1}


def test_the_truth_as_reference_is_laid_on_the_take_and_finds_the_errors_of_filters() -> None:
    """Its clock, world and clusters are unknown; Mahony's filter is within 2° of the truth on the shank."""
    _, truth = simulated("comfortable")
    comparison = compare("mahony_2008", magnetometer=False, reference=truth_table(truth))
    r = comparison.reference
    assert r is not None
    assert r.lag_s == pytest.approx(-LAG_S, abs=0.003)
    assert r.correlation > 0.95
    assert set(r.segments) == {"pelvis", "shank_l", "foot_l"}
    for name in (None, "mahony_2008"):
        for score in r.scores[name].values():
            assert np.radians(0.1) < score.total < np.radians(2.0)
    knees = {b.quantity for b in r.agreement if b.filter == "mahony_2008"}
    assert knees == {
        *(f"{s}_{q}" for s in r.segments for q in ("inclination", "heading")),
        "ankle_dorsiflexion_l", "ankle_inversion_l", "ankle_rotation_l", "pelvis_tilt", "pelvis_obliquity",
    }  # fmt: skip
    ankle = next(b for b in r.agreement if (b.filter, b.quantity) == ("mahony_2008", "ankle_dorsiflexion_l"))
    assert ankle.low < ankle.bias < ankle.high
    assert ankle.rmse**2 == pytest.approx(ankle.bias**2 + ((ankle.high - ankle.low) / 3.92) ** 2, rel=1e-3)


def test_a_reference_of_the_walk_alone_gives_joint_angles_too() -> None:
    _, truth = simulated("comfortable")
    table = truth_table(truth)
    walk = slice(1000, 3000)
    table = replace(table, t_s=table.t_s[walk], q={s: q[walk] for s, q in table.q.items()})
    r = compare("mahony_2008", magnetometer=False, reference=table).reference
    assert r is not None
    assert r.lag_s == pytest.approx(-LAG_S, abs=0.003)
    ankle = next(b for b in r.agreement if b.quantity == "ankle_dorsiflexion_l")
    assert np.degrees(ankle.rmse) < 2.0
    assert ankle.n == pytest.approx(1000, abs=2)


def test_an_error_of_the_reference_that_comes_and_goes_is_found_in_the_rmse() -> None:
    _, truth = simulated("comfortable")
    wave = exp(np.radians(10.0) * np.sin(0.5 * truth.t_s)[:, None] * np.array([1.0, 0.0, 0.0]))
    plain, off = (
        compare("mahony_2008", magnetometer=False, reference=truth_table(truth, error)).reference
        for error in (None, wave)
    )
    assert plain is not None
    assert off is not None
    for s in plain.segments:
        a, b = plain.scores["mahony_2008"][s].total, off.scores["mahony_2008"][s].total
        # 10° as a sine is 7.1° RMS; the constant turns may take little of it
        assert np.degrees(np.sqrt(b**2 - a**2)) == pytest.approx(7.1, abs=1.0)


def test_a_reference_of_another_movement_is_refused() -> None:
    _, truth = simulated("comfortable")
    t = np.arange(0.0, 40.0, 0.01)
    second = {"pelvis": about(0, 0.3 * np.sin(t**1.5))}
    with pytest.raises(FormatError, match="correlate") as caught:
        compare("mahony_2008", reference=OrientationTable("other.csv", t, second))
    assert caught.value.code == "other_movement"
    with pytest.raises(FormatError) as caught:
        compare("mahony_2008", reference=replace(truth_table(truth), q={"head": truth.q["pelvis"]}))
    assert caught.value.code == "no_common_segment"
    whole = truth_table(truth)
    for rows in (2, 200):
        short = replace(whole, t_s=whole.t_s[:rows], q={s: x[:rows] for s, x in whole.q.items()})
        with pytest.raises(FormatError) as caught:
            compare("mahony_2008", reference=short)
        assert caught.value.code == "no_overlap"
    # what would take 16 GB on the take's axis
    with pytest.raises(FormatError, match="time_ms") as caught:
        compare("mahony_2008", reference=replace(whole, t_s=1e6 * whole.t_s))
    assert caught.value.code == "too_long"


def test_two_constant_turns_are_found_from_motion_about_several_axes() -> None:
    rng = np.random.default_rng(3)
    q = normalise(rng.standard_normal((200, 4)))
    world, sensor = normalise(rng.standard_normal((2, 4)))
    noisy = multiply(multiply(multiply(world, q), sensor), exp(0.01 * rng.standard_normal((200, 3))))
    a, b = fit_frames(noisy, q)
    assert angle_between(a, world) < 0.005
    assert angle_between(b, sensor) < 0.005


@pytest.mark.parametrize(
    ("n", "rate_hz", "kept"), [(6000, 100.0, 3000), (60_000, 100.0, 30_000), (400_000, 200.0, 28_572)]
)
def test_what_is_kept_is_bounded(n: int, rate_hz: float, kept: int) -> None:
    assert len(range(n)[choose_samples(n, rate_hz)]) == kept
