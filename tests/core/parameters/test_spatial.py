"""Distances from the paths of the feet: hand-made paths with known answers, and simulated truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sagittal.core.body.feet import FootTracks
from sagittal.core.body.model import BodyModel
from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import FOOT, R_NEUTRAL, SIDES, Bools, Floats, Side
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.rows import figure_columns
from sagittal.core.parameters.spatial import (
    NAMES,
    Surface,
    in_place,
    measure_distances,
    summarise_distances,
)
from sagittal.core.rotation import about, from_matrix, multiply
from sagittal.core.simulate import WalkTruth
from tests.helpers.walks import simulated

RATE = 100.0
BODY = BodyModel(
    hip_width=0.18, thigh=0.42, shank=0.42, ankle_height=0.08, foot=0.26, estimated=True, standing_width=0.2,
    sole_back=0.055, sole_front=0.2,
)  # fmt: skip
TURN = 1.0  # s of one stride


def feet(
    heading: float = 0.0,
    width: float = 0.12,
    length: float = 1.3,
    late: float = 0.5,
    swing_out: float = 0.05,
    climb: float = 0.0,
    linked: bool = True,
) -> FootTracks:
    """Six strides per foot along a heading; the left foot lands `late` of a stride length before the right.

    Each foot rests for 0.6 s of each 1 s and swings for 0.4 s, half a second out of step with the other.
    """
    t = np.arange(round(8 * RATE)) / RATE
    p: dict[Side, Floats] = {}
    still: dict[Side, Bools] = {}
    along, left = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    for side in SIDES:
        phase, ahead = (0.5, late - 0.5) if side == "left" else (0.0, 0.0)
        k = np.clip(t - phase, 0.0, 6.0)
        whole, u = np.floor(k), np.clip((k - np.floor(k) - 0.6) / 0.4, 0.0, 1.0)
        s = (whole + u + (phase and ahead + 0.5)) * length
        out = swing_out * 4 * u * (1 - u) + 0.5 * width
        lateral = out if side == "left" else -out
        height = BODY.ankle_height + 0.1 * 4 * u * (1 - u) + climb * t
        p[side] = np.column_stack((s[:, None] * along + lateral[:, None] * left, height))
        still[side] = (u == 0.0) | (u == 1.0)
    q = multiply(about(2, heading), from_matrix(R_NEUTRAL))
    valid = np.ones(len(t), bool)
    return FootTracks(
        t, RATE, p, dict.fromkeys(SIDES, np.tile(q, (len(t), 1))), still, dict.fromkeys(SIDES, valid), linked,
        "erkf_smoothed", BODY,
    )  # fmt: skip


def strides() -> Strides:
    """Contacts of the walk of `feet`: every foot lands at the end of its swing."""
    made = [
        Stride(side, k + at, k + at + 0.6, k + at + 1.0, k + at + 0.1, k + at + 0.5)
        for side in SIDES
        for at in [0.5 if side == "left" else 0.0]
        for k in range(1, 5)
    ]
    return Strides(tuple(made))


def by_name(found: tuple[Parameter, ...]) -> Mapping[tuple[str, Side | None], Parameter]:
    return {(p.name, p.side): p for p in found}


def parameters(
    tracks: FootTracks | None, surface: Surface | None = None
) -> Mapping[tuple[str, Side | None], Parameter]:
    surface = surface or Surface()
    figures = measure_distances(strides(), tracks, surface)
    return by_name(summarise_distances(strides(), tracks, figures, surface))


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.5])
def test_known_paths_give_their_lengths_whatever_the_heading(heading: float) -> None:
    found = parameters(feet(heading, late=0.4))
    assert found["stride_length_m", "left"].mean == pytest.approx(1.3)
    assert found["stride_length_m", "right"].sd == pytest.approx(0.0, abs=1e-9)
    assert found["gait_speed_mps", None].mean == pytest.approx(1.3)
    assert found["gait_speed_mps", None].n == 8
    # the left foot lands .4 of a stride in front of the right one, which then has .6 to go
    assert found["step_length_m", "left"].mean == pytest.approx(0.4 * 1.3)
    assert found["step_length_m", "right"].mean == pytest.approx(0.6 * 1.3)
    for side in SIDES:
        assert found["step_width_m", side].mean == pytest.approx(0.12)
        assert found["circumduction_m", side].mean == pytest.approx(0.05, abs=1e-4)
    assert found["total_distance_m", None].mean == pytest.approx(6 * 1.3)


def test_feet_that_cross_have_a_negative_width() -> None:
    assert parameters(feet(width=-0.06))["step_width_m", "left"].mean == pytest.approx(-0.06)


def test_without_the_standing_width_there_is_no_width() -> None:
    found = parameters(replace(feet(), body=replace(BODY, standing_width=None)))
    assert found["step_width_m", "left"].reason == "standing_width_unknown"
    assert found["step_length_m", "left"].mean is not None


def test_a_small_step_within_a_stance_does_not_move_the_flat_before_it() -> None:
    """In a turn the foot is set down a second time, longer; the stride that came before ends at the first."""
    tracks = feet()
    p, still = tracks.p["left"].copy(), tracks.still["left"].copy()
    p[round(5.5 * RATE) : round(6.05 * RATE), 0] = p[round(5.5 * RATE), 0]
    moved = slice(round(6.05 * RATE), None)
    p[moved, 0] = p[round(6.0 * RATE), 0] + 0.1
    still[round(5.5 * RATE) : round(6.0 * RATE)] = True
    still[round(6.0 * RATE) : round(6.1 * RATE)] = False
    still[round(6.1 * RATE) :] = True
    turned = replace(tracks, p={**tracks.p, "left": p}, still={**tracks.still, "left": still})
    long = Stride("left", 5.5, 7.5, 8.0)
    known = Strides((*(s for s in strides().strides if s.end_s <= 5.5), long))
    lengths = measure_distances(known, turned)["stride_length_m"].values
    before = next(i for i, s in enumerate(known.strides) if s.side == "left" and s.end_s == 5.5)
    assert lengths[before] == pytest.approx(1.3, abs=0.02)


def test_a_foot_that_comes_down_where_it_was_made_no_stride() -> None:
    """Marching on the spot has contacts like walking, and leads nowhere; on a belt every stride does."""
    tracks = feet(length=0.02)
    assert in_place(strides(), tracks).tolist() == list(range(len(strides().strides)))
    assert not len(in_place(strides(), feet()))
    assert not len(in_place(strides(), None))
    assert not len(in_place(strides(), tracks, Surface("treadmill", 1.0)))
    assert parameters(tracks)["stride_length_m", "left"].reason == "in_place"


def test_drift_in_height_leaves_clearance_as_it_is() -> None:
    level, climbing = parameters(feet()), parameters(feet(climb=0.05))
    want = level["max_heel_clearance_m", "left"].mean
    assert want == pytest.approx(0.1, abs=1e-3)
    assert climbing["max_heel_clearance_m", "left"].mean == pytest.approx(want, abs=2e-3)


def test_what_cannot_be_known_has_a_reason() -> None:
    assert parameters(None)["stride_length_m", "left"].reason == "no_foot_track"
    assert parameters(None)["total_distance_m", None].reason == "no_foot_track"
    lone = parameters(feet(linked=False))
    assert lone["step_length_m", "left"].reason == "feet_not_linked"
    assert lone["step_width_m", "right"].reason == "feet_not_linked"
    assert lone["stride_length_m", "left"].mean == pytest.approx(1.3)
    restless = replace(feet(), still=dict.fromkeys(SIDES, np.zeros(800, bool)))
    assert parameters(restless)["gait_speed_mps", None].reason == "no_foot_flat"
    assert parameters(restless)["total_distance_m", None].reason == "no_foot_flat"
    barefoot = parameters(replace(feet(), body=replace(BODY, sole_back=None)))
    assert barefoot["min_toe_clearance_m", "left"].reason == "no_shoe_geometry"
    assert barefoot["max_heel_clearance_m", "left"].reason == "no_shoe_geometry"
    none = Strides(())
    nobody = {p.reason for p in summarise_distances(none, None, measure_distances(none, None))}
    assert nobody == {"no_strides", "no_foot_track"}


def test_a_stride_with_a_lost_sensor_has_no_length() -> None:
    tracks = feet()
    valid = tracks.valid["left"].copy()
    valid[290:300] = False
    found = measure_distances(strides(), replace(tracks, valid={**tracks.valid, "left": valid}))
    lengths, left = found["stride_length_m"], strides().columns.of["left"]
    assert sorted(lengths.reasons[left]) == ["", "", "", "gap"]
    assert np.isfinite(lengths.values[left]).sum() == 3


def test_a_path_that_is_not_known_is_a_gap_and_no_number() -> None:
    tracks = feet()
    torn = tracks.p["left"].copy()
    torn[250:260] = np.nan
    found = measure_distances(strides(), replace(tracks, p={**tracks.p, "left": torn}))["circumduction_m"]
    left = strides().columns.of["left"]
    assert sorted(found.reasons[left]) == ["", "", "", "gap"]
    assert np.isfinite(found.values[left]).sum() == 3


def test_one_foot_alone_has_no_steps() -> None:
    tracks = feet()
    alone = replace(tracks, p={"left": tracks.p["left"]}, still={"left": tracks.still["left"]}, linked=False)
    found = parameters(alone)
    assert found["step_length_m", "left"].reason == "opposite_foot_missing"
    assert found["stride_length_m", "right"].reason == "no_foot_track"
    assert found["stride_length_m", "left"].mean == pytest.approx(1.3)


def test_a_treadmill_gives_what_its_belt_gives_and_nothing_else() -> None:
    unknown = parameters(feet(), Surface("treadmill"))
    assert {p.reason for p in unknown.values()} == {"treadmill"}
    known = parameters(feet(), Surface("treadmill", 1.1))
    assert known["gait_speed_mps", None].mean == 1.1
    assert known["stride_length_m", "left"].mean == pytest.approx(1.1 * TURN)
    others = {p.reason for (name, _), p in known.items() if name not in {"gait_speed_mps", "stride_length_m"}}
    assert others == {"treadmill"}


def test_strides_have_their_own_columns() -> None:
    columns = figure_columns(measure_distances(strides(), feet(linked=False)))
    assert set(columns) == set(NAMES)
    assert columns["stride_length_m"] == pytest.approx((1.3,) * 8)
    assert columns["step_length_m"] == (None,) * 8


def true_tracks(truth: WalkTruth) -> FootTracks:
    """The feet as they really went."""
    p, q = ({s: of[FOOT[s]] for s in SIDES} for of in (truth.p, truth.q))
    valid = dict.fromkeys(SIDES, np.ones(len(truth.t_s), bool))
    return FootTracks(truth.t_s, RATE, p, q, truth.flat, valid, True, "truth", BODY)


def true_strides(truth: WalkTruth) -> Strides:
    """All true strides with the other foot's contact inside."""
    made = []
    for s in truth.strides:
        other = [x.start_s for x in truth.strides if x.side != s.side and s.start_s < x.start_s < s.end_s]
        other += [x.end_s for x in truth.strides if x.side != s.side and s.start_s < x.end_s < s.end_s]
        made.append(Stride(s.side, s.start_s, s.release_s, s.end_s, None, min(other, default=None)))
    return Strides(tuple(made))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fast_with_turns", "hemiparetic", "drop_foot"])
def test_true_paths_give_the_true_lengths_and_widths(name: str) -> None:
    truth = simulated(name, 5)[1]
    found = measure_distances(true_strides(truth), true_tracks(truth))
    lengths, widths = found["stride_length_m"].values, found["step_width_m"].values
    assert lengths == pytest.approx(np.array([s.length_m for s in truth.strides]), abs=1e-6)
    known = np.isfinite(widths)
    true_widths = np.array([s.width_m for s in truth.strides])
    assert known.any()
    assert np.abs(widths[known]) == pytest.approx(true_widths[known], abs=1e-6)


def test_an_affected_side_shows_in_sign_and_size() -> None:
    truth = simulated("hemiparetic", 5)[1]
    strides_ = true_strides(truth)
    figures = measure_distances(strides_, true_tracks(truth))
    found = by_name(summarise_distances(strides_, true_tracks(truth), figures))
    steps = {s: found["step_length_m", s].mean for s in SIDES}
    assert steps["left"] is not None
    assert steps["right"] is not None
    # the paretic left steps longer, as its walker was made (docs/science/simulation.md, "Virtual people")
    assert steps["left"] / steps["right"] > 1.1
    assert found["circumduction_m", "left"].mean == pytest.approx(0.14, abs=0.03)
    assert found["circumduction_m", "right"].mean == pytest.approx(0.03, abs=0.02)


@pytest.mark.slow
def test_the_way_of_a_walk_is_that_of_its_footprints() -> None:
    truth = simulated("comfortable", 5)[1]
    tracks = true_tracks(truth)
    ways = []
    for side in SIDES:
        flat = truth.flat[side]
        edges = np.flatnonzero(np.diff(np.concatenate(([False], flat, [False]))))
        places = [tracks.p[side][(a + b) // 2, :2] for a, b in zip(edges[::2], edges[1::2], strict=True)]
        ways.append(sum(float(np.linalg.norm(b - a)) for a, b in pairwise(places)))
    none = Strides(())
    found = by_name(summarise_distances(none, tracks, measure_distances(none, tracks)))
    assert found["total_distance_m", None].mean == pytest.approx(np.mean(ways), abs=0.05)
