"""What sources of other gait software were seen to get wrong: each is a test that ours does not."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sagittal.core.body.feet import FootTracks
from sagittal.core.body.model import BodyModel
from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.parameters import stride_values, summarise_times
from sagittal.core.parameters.catalogue import unit_of
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.rows import read_row
from sagittal.core.parameters.spatial import measure_distances
from sagittal.core.parameters.symmetry import compare_sides
from sagittal.core.simulate import simulate_scenario
from tests.helpers.true_walks import true_tracks

STRIDE = Stride("left", 1.0, 1.7, 2.2, 1.15, 1.55)


def test_a_step_is_not_a_swing() -> None:
    """Seen: step duration = contact − own foot-off, which is the swing."""
    values = stride_values(STRIDE)
    assert values["step_time_s"] == pytest.approx(0.65)
    assert values["swing_time_s"] == pytest.approx(0.5)


def test_percent_is_never_a_fraction_and_time_never_percent() -> None:
    """Seen: keys that say percent and hold fractions; supports called "time" in percent."""
    values = stride_values(STRIDE)
    assert values["stance_pct"] == pytest.approx(100 * 0.7 / 1.2)
    assert values["stance_pct"] + values["swing_pct"] == pytest.approx(100.0)  # type: ignore[operator]
    for name, value in values.items():
        if name.endswith("_pct"):
            seconds = values[f"{name[:-4]}_time_s" if name[:-4] in ("stance", "swing") else f"{name[:-4]}_s"]
            assert value == pytest.approx(100.0 * seconds / 1.2)  # type: ignore[operator]


@pytest.mark.slow
def test_every_number_has_the_unit_that_its_name_says() -> None:
    """Seen: documentation says hours, the code gives minutes."""
    tracks = true_tracks(simulate_scenario("comfortable", 5).truth)
    measured = measure_gait(tracks)
    bare = ("harmonic_ratio_", "step_regularity_", "stride_regularity_", "stride_sparc")
    for p in measured.parameters:
        assert p.unit == unit_of(p.name), p.name
        assert p.unit or p.name.endswith("_count") or p.name.startswith(bare), p.name


def test_two_zeros_are_not_symmetric_and_an_index_is_not_absolute() -> None:
    """Seen: the index is absolute, so that the side is lost, and 0 when both sides are 0."""

    def index(left: float, right: float) -> float | None:
        pair: list[Parameter] = [
            Parameter("step_length_m", side, 12, value, None, "m")
            for side, value in zip(SIDES, (left, right), strict=True)
        ]
        return compare_sides(pair)[0].index_pct

    assert index(0.0, 0.0) is None
    assert index(0.5, 0.6) == pytest.approx(-index(0.6, 0.5))  # type: ignore[operator]


def test_who_stands_has_no_stance_share() -> None:
    """Seen: the stance ratio falls back to 1.0 when nobody walks."""
    found = summarise_times(Strides(()))
    assert {p.mean for p in found} == {None}
    assert {p.reason for p in found} == {"no_strides"}


def feet(pause_s: float) -> FootTracks:
    """A left foot that goes 1.3 m in .4 s; its second rest lasts so much longer, its middle comes later."""
    t = np.arange(0.0, 5.0, 0.01)
    rests = [(0.0, 0.6), (1.0, 1.6 + pause_s), (2.0 + pause_s, 2.6 + pause_s)]
    x, still = np.zeros(len(t)), np.zeros(len(t), np.bool_)
    for k, (a, b) in enumerate(rests):
        still |= (t >= a) & (t < b)
        x = np.where(t >= a, 1.3 * k, x)
    for k, ((_, b), (a, _)) in enumerate(pairwise(rests)):
        inside = (t >= b) & (t < a)
        x[inside] = 1.3 * (k + (t[inside] - b) / (a - b))
    p: dict[Side, Floats] = {"left": np.stack((x, np.zeros(len(t)), np.full(len(t), 0.08)), axis=1)}
    q: dict[Side, Floats] = {"left": np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))}
    masks = {"left": still}, {"left": np.ones(len(t), np.bool_)}
    return FootTracks(t, 100.0, p, q, *masks, False, "truth", BodyModel.from_height(1.7))  # type: ignore[arg-type]


@pytest.mark.parametrize("pause", [0.0, 0.5])
def test_speed_is_length_and_time_of_the_same_window(pause: float) -> None:
    """Seen: length between flats divided by the time between contacts, another window."""
    stride = Stride("left", 0.0, 0.6, 1.0)
    row = read_row(measure_distances(Strides((stride,)), feet(pause)), 0)
    # from the middle of the first rest to that of what is looked at of the second one, .7 s at most
    between = 1.0 + 0.5 * min(0.6 + pause, 0.7) - 0.3
    assert row["stride_length_m"] == pytest.approx(1.3)
    assert row["gait_speed_mps"] == pytest.approx(1.3 / between, rel=0.01)


def test_the_lift_of_a_sensor_is_not_the_clearance_of_the_toe() -> None:
    """Seen: the highest point of the sensor given as clearance."""
    row = read_row(measure_distances(Strides((Stride("left", 0.0, 0.6, 1.0),)), feet(0.0)), 0)
    assert row["min_toe_clearance_m"] == "no_shoe_geometry"


@pytest.mark.slow
def test_no_gait_gives_a_clean_empty_result() -> None:
    """Seen: crash when there is no gait, or "done" without saying anything."""
    tracks = true_tracks(simulate_scenario("comfortable", 5).truth)
    measured = measure_gait(replace(tracks, events=replace(tracks.events, events=())))
    assert measured.strides.strides == ()
    # nobody walked: the count is a true 0, the way is that of the feet
    silent = [p for p in measured.parameters if not p.name.endswith(("_count", "total_distance_m"))]
    assert {p.mean for p in silent} == {None}
    assert all(p.reason for p in silent)
