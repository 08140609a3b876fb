"""Loading, foot flat and push-off: pitches with known answers, and simulated feet whose flat is exact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians

import numpy as np
import pytest

from sagittal.core.events.result import Stride, Strides
from sagittal.core.frames import FOOT, R_NEUTRAL, Bools, Floats, Segment, Side
from sagittal.core.parameters.rows import side_parameters
from sagittal.core.parameters.stance import FLAT_RAD, NAMES, Stances, find_stances, foot_pitches
from sagittal.core.rotation import about, from_matrix, multiply
from sagittal.core.simulate import simulate_scenario
from tests.helpers.true_walks import true_tracks

T = np.arange(0.0, 12.0, 0.01)


def walked(
    landing_deg: float = 18.0, level_deg: float = 0.0, push_deg: float = -60.0, stance_s: float = 0.6
) -> dict[Segment, Floats]:
    """A left foot that lands every second, comes flat in .1 s, stays .3 s and rises until it leaves."""
    u = (T % 1.0) / stance_s
    down = landing_deg * np.clip(1.0 - u * 6.0, 0.0, 1.0)
    up = push_deg * np.clip((u - 4.0 / 6.0) * 3.0, 0.0, 1.0)
    return {"foot_l": np.radians(level_deg + down + up)}


def strides(side: Side = "left", stance_s: float = 0.6) -> Strides:
    return Strides(tuple(Stride(side, k, k + stance_s, k + 1.0) for k in range(1, 9)))


def parts(found: Stances) -> dict[str, float | str]:
    return {p.name: p.mean if p.mean is not None else str(p.reason)
            for p in side_parameters(strides(), found.parts) if p.side == "left"}  # fmt: skip


@pytest.mark.parametrize("level", [0.0, 4.0, -6.0])
def test_the_three_parts_are_where_the_pitch_passes_three_degrees(level: float) -> None:
    found = parts(find_stances(strides(), T, walked(level_deg=level)))
    # down from 18° in a sixth of stance passes 3° after 15/18 of it; up by 60° in a third after 3/60 of it
    assert found["loading_pct"] == pytest.approx(100 / 6 * 15 / 18, abs=0.3)
    assert found["push_pct"] == pytest.approx(100 / 3 * 57 / 60, abs=0.3)
    assert found["foot_flat_pct"] == pytest.approx(100 - 100 / 6 * 15 / 18 - 100 / 3 * 57 / 60, abs=0.5)


def test_the_parts_are_the_whole_stance() -> None:
    found = find_stances(strides(), T, walked())
    assert list(found.parts) == list(NAMES)
    assert sum(x.values for x in found.parts.values()) == pytest.approx(np.full(8, 100.0))
    assert found.flat_s[0] == pytest.approx(1.0833, abs=0.005)
    assert found.heel_off_s[0] == pytest.approx(1.41, abs=0.005)


def test_a_flat_landing_has_no_loading() -> None:
    assert parts(find_stances(strides(), T, walked(landing_deg=0.0)))["loading_pct"] == 0.0


def test_who_walks_on_the_toes_has_no_flat_foot() -> None:
    assert set(parts(find_stances(strides(), T, walked(level_deg=-20.0))).values()) == {"no_foot_flat"}


def test_a_foot_that_never_stops_rolling_is_never_flat() -> None:
    rolling: dict[Segment, Floats] = {"foot_l": np.radians(20.0 - 80.0 * (T % 1.0))}
    assert set(parts(find_stances(strides(), T, rolling)).values()) == {"no_foot_flat"}


def test_what_is_missing_has_its_own_reason() -> None:
    assert set(parts(find_stances(strides(), T, {})).values()) == {"no_foot_sensor"}
    lost = walked()
    lost["foot_l"][150:1000] = np.nan
    assert find_stances(strides(), T, lost).parts["push_pct"].reasons[1] == "gap"
    no_tc = Strides(tuple(Stride("left", k, None, k + 1.0) for k in range(1, 9)))
    assert find_stances(no_tc, T, walked()).parts["loading_pct"].reasons[0] == "no_terminal_contact"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["comfortable", "hemiparetic", "antalgic", "drop_foot"])
def test_simulated_feet_are_flat_when_they_really_are(name: str) -> None:
    """The exact flat begins and ends at 0°, ours 3° away from it: it lasts longer, by what 3° take; a weak
    push-off raises the heel slowly."""
    truth = simulate_scenario(name, 5).truth
    tracks = true_tracks(truth)
    pitch = foot_pitches(tracks)
    made = [s for s in truth.strides if s.lift5_s is not None]
    found = find_stances(
        Strides(tuple(Stride(s.side, s.start_s, s.lift5_s, s.end_s) for s in made)), truth.t_s, pitch
    )
    for s, flat, heel_off in zip(made, found.flat_s, found.heel_off_s, strict=True):
        exact = truth.contacts[s.side]
        begins = exact.flat[np.argmin(np.abs(exact.contact - s.start_s))]
        ends = exact.heel_off[np.searchsorted(exact.heel_off, begins)]
        angle = np.degrees(np.interp([flat, heel_off], truth.t_s, pitch[FOOT[s.side]]))
        assert np.abs(angle) == pytest.approx(np.minimum(3.0, np.abs(angle)), abs=0.3)
        assert s.start_s <= flat <= begins + 0.011
        assert ends - 0.011 <= heel_off <= ends + 0.20


def test_the_limit_is_a_centimetre_of_a_foot() -> None:
    assert 0.2 * np.sin(FLAT_RAD) == pytest.approx(0.01, abs=0.001)


@dataclass(frozen=True)
class Foot:
    """One foot over three samples, the last of them lost."""

    t_s: Floats
    q: Mapping[Segment, Floats]
    valid: Mapping[Segment, Bools]


def test_pitch_is_toes_up_whatever_the_heading() -> None:
    tipped = multiply(about(1, -radians(20.0)), from_matrix(R_NEUTRAL))
    q = multiply(about(2, np.array([0.0, 1.3, 0.0])), tipped)
    pitch = foot_pitches(Foot(T[:3], {"foot_l": q}, {"foot_l": np.array([True, True, False])}))["foot_l"]
    assert pitch[:2] == pytest.approx(np.full(2, radians(20.0)))
    assert np.isnan(pitch[2])
