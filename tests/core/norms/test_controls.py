"""A clinic's own controls as a reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.norms.controls import ControlSession, control_group, mean_curves
from sagittal.core.norms.profile import NINE
from sagittal.core.norms.scores import score_curves
from sagittal.core.norms.values import Sex
from sagittal.core.parameters.kinematic import MEAN_ZERO
from sagittal.core.parameters.result import CycleCurves, Parameter
from tests.helpers.wbds import people


def session(
    person: str,
    left: float = 60.0,
    right: float = 60.0,
    speed: float = 1.2,
    age: float | None = 40.0,
    sex: Sex | None = "female",
    curves: Mapping[Side, Mapping[str, Floats]] | None = None,
) -> ControlSession:
    parameters = [
        Parameter("stance_pct", "left", 20, left, 1.0, "%"),
        Parameter("stance_pct", "right", 20, right, 1.0, "%"),
        Parameter("gait_speed_mps", None, 40, speed, 0.1, "m/s"),
        Parameter("step_width_m", "left", 0, None, None, "m", "standing_width_unknown"),
    ]
    return ControlSession(person, age, sex, parameters, curves or {})


def test_mean_and_spread_are_between_people_one_side_at_a_time() -> None:
    group = control_group([session(f"c{i}", 60.0 + i, 62.0 + i, 1.0 + 0.1 * i) for i in range(5)])
    stance = group.values["stance_pct"]
    assert stance.n == 5
    assert stance.mean == pytest.approx(63.0)
    assert stance.sd == pytest.approx(np.sqrt(2.5)), "the same in both columns; sides are not mixed"
    assert stance.difference_sd == pytest.approx(0.0, abs=1e-9)
    assert stance.comparable
    speed = group.values["gait_speed_mps"]
    assert speed.mean == pytest.approx(1.2)
    assert speed.sd == pytest.approx(np.sqrt(0.025))
    assert speed.difference_sd is None
    assert "step_width_m" not in group.values
    assert (group.reason, group.note) == (None, "small_group")


def test_a_person_measured_often_counts_once() -> None:
    sessions = [session(f"c{i}", 60.0 + i) for i in range(5)]
    often = sessions + [session("c4", 60.0 + x) for x in (2.0, 6.0)] * 3
    assert control_group(often).n == 5
    assert control_group(often).values["stance_pct"].mean == pytest.approx(
        control_group(sessions).values["stance_pct"].mean
    )


def test_visits_of_too_few_strides_make_no_reference() -> None:
    whole = [session(f"c{i}", 60.0 + i) for i in range(5)]
    short = session("c5", 90.0)
    short = replace(short, parameters=[replace(p, n=3) for p in short.parameters])
    group, steady = control_group([*whole, short]).values, control_group(whole).values
    assert {k: (v.mean, v.sd, v.n) for k, v in group.items()} == {
        k: (v.mean, v.sd, v.n) for k, v in steady.items()
    }
    curves = CycleCurves(
        {"knee_flexion": {"left": np.full((3, 101), 0.2)}}, {"left": (0, 1, 2)},
        {"left": np.ones(3, np.bool_)}, {"left": np.full(3, 62.0)},
    )  # fmt: skip
    assert mean_curves(curves) == {}


def test_estimated_angles_of_controls_are_no_reference() -> None:
    def of(person: str, value: float, *, estimated: bool) -> ControlSession:
        knee = Parameter("knee_flexion_rom_deg", "left", 20, value, 1.0, "deg", estimated=estimated)
        return replace(session(person), parameters=[*session(person).parameters, knee])

    measured = [of(f"c{i}", 60.0 + i, estimated=False) for i in range(5)]
    guessed = [of(f"e{i}", 30.0, estimated=True) for i in range(5)]
    values = control_group([*measured, *guessed]).values
    assert values["knee_flexion_rom_deg"].mean == pytest.approx(62.0)
    assert values["knee_flexion_rom_deg"].n == 5
    assert values["stance_pct"].n == 10
    curves = CycleCurves(
        {"knee_flexion": {"left": np.full((5, 101), 0.2)}}, {"left": (0, 1, 2, 3, 4)},
        {"left": np.ones(5, np.bool_)}, {"left": np.full(5, 62.0)},
    )  # fmt: skip
    assert "knee_flexion" in mean_curves(curves)["left"]
    assert mean_curves(curves, ("knee_flexion",)) == {}


def test_fewer_than_five_people_are_no_group() -> None:
    group = control_group([session(f"c{i % 4}") for i in range(20)])
    assert (group.n, group.reason, dict(group.values), dict(group.bands)) == (4, "few_controls", {}, {})
    assert group.reference is None
    assert group.norms(1.2).place("stance_pct", 60.0).reason == "few_controls"


def test_controls_are_chosen_by_age_sex_and_speed() -> None:
    """Slow walkers of the clinic give the speed-matched reference that no table has."""
    slow = [session(f"s{i}", 66.0 + i, 66.0 + i, 0.6, 70.0 + i) for i in range(5)]
    quick = [session(f"q{i}", 60.0 + i, 60.0 + i, 1.3, 30.0 + i, "male") for i in range(6)]
    unknown = [session(f"u{i}", 50.0, 50.0, 0.6, None, None) for i in range(6)]
    group = control_group([*slow, *quick, *unknown], age=(65, 80), sex="female", speed_mps=(0.5, 0.7))
    assert group.n == 5
    assert group.values["stance_pct"].mean == pytest.approx(68.0)
    assert group.group == "own controls, female, 65 to 80 years, 0.5 to 0.7 m/s"
    assert group.norms(0.6).place("stance_pct", 68.0).z == pytest.approx(0.0)
    assert control_group(quick, sex="male").n == 6
    assert control_group(quick, sex="female").reason == "few_controls"


@pytest.mark.recorded
def test_controls_score_raw_from_standing_because_they_stand_alike() -> None:
    """The 42 adults as controls: their own spread, and a person of theirs scored against it."""
    controls = [session(f"c{i}", curves=p) for i, p in enumerate(people())]
    group = control_group(controls)
    assert (group.n, group.note) == (42, None)
    assert group.reference is not None
    assert group.reference.spreads["raw"]["gps_side"].mean_deg == pytest.approx(4.954, abs=0.001)
    person = people()[7]
    curves = CycleCurves(
        {v: {s: np.radians(np.tile(person[s][v], (4, 1))) for s in SIDES} for v in NINE},
        dict.fromkeys(SIDES, (0, 1, 2, 3)),
        {s: np.ones(4, np.bool_) for s in SIDES},
        {s: np.full(4, 62.0) for s in SIDES},
    )
    scores = score_curves(curves, reference=group.reference)
    assert scores.zero == "standing"
    raw = scores.find("gps_deg", "raw")
    assert raw.value is not None
    assert 2.0 < raw.value < 9.0
    assert score_curves(curves).find("gps_deg", "raw").reason == "variables_missing"
    retained = mean_curves(curves)
    assert retained["left"]["knee_flexion"] == pytest.approx(person["left"]["knee_flexion"])


@pytest.mark.recorded
def test_the_band_of_controls_is_the_spread_of_single_sides() -> None:
    group = control_group([session(f"c{i}", curves=p) for i, p in enumerate(people())])
    knee = group.bands["knee_flexion"]
    rows = [np.std([p[s]["knee_flexion"] for p in people()], axis=0, ddof=1) for s in SIDES]
    assert knee.sd_deg == pytest.approx(np.sqrt(np.mean(np.square(rows), axis=0)))
    assert knee.mean_deg[72] == pytest.approx(60.0, abs=2.0)
    assert {v: b.zero for v, b in group.bands.items()} == {
        v: "stride_mean" if v in MEAN_ZERO else "standing" for v in NINE
    }
