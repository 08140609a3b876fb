"""Functional tests: twelve simulated people, and what real recordings hold of rises, turns and standing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.body.tree import PRESETS
from sagittal.core.events.turns import find_turns
from sagittal.core.frames import Segment
from sagittal.core.functional_tests.guided import GuidedTest
from sagittal.core.functional_tests.rising import find_changes
from sagittal.core.functional_tests.sway import SwayParams, measure_sway
from sagittal.core.functional_tests.trunk import follow_trunk
from sagittal.core.functional_tests.tug import measure_tug
from sagittal.core.online import OnlineSession
from sagittal.core.pipeline import analyse
from sagittal.core.simulate import Stand, Straight, simulate
from sagittal.core.simulate.patients import PATIENTS
from sagittal.core.simulate.scripts import ON_SKIN
from sagittal.core.simulate.tug import simulate_tug
from sagittal.core.timeline import synchronise
from tests.core.functional_tests.test_guided import blocks, followed
from tests.helpers.ipol import ipol_recording
from tests.helpers.kept import keep
from tests.helpers.live_walks import batches, hello_of
from tests.helpers.mobgap import turns_of, uniform
from tests.helpers.walks import neura_walk
from validation.accuracy.test_events_trunk_qmt import take
from validation.figures import record

WORN: tuple[Segment, ...] = ("pelvis", "chest")
SEEDS = (1, 5)
PARTS = ("sit_to_stand", "walk_out", "turn", "walk_back", "turn_to_sit", "final_turn", "stand_to_sit")
CLOCK_S = 40.0
"""qmt_fullbody's own clock begins at 40 s."""


@keep
def tug_errors(segment: Segment, patient: str) -> dict[str, tuple[float, ...]]:
    """Segment, "total" → found − true duration in s, of every seed."""
    errors: dict[str, list[float]] = {name: [] for name in (*PARTS, "total")}
    for seed in SEEDS:
        simulation = simulate_tug(patient, seed, setup=replace(ON_SKIN, worn=(segment,)), left=seed % 2 == 1)
        result = measure_tug(follow_trunk(synchronise(simulation.recording)))
        got = {p.name: p.mean for p in result.parameters}
        for part in simulation.truth.segments:
            value = got[f"tug_{part.kind}_s"]
            assert value is not None, (patient, part.kind)
            errors[part.kind].append(value - (part.end_s - part.start_s))
        total = got["tug_duration_s"]
        assert total is not None, patient
        errors["total"].append(total - simulation.truth.duration_s)
    return {name: tuple(values) for name, values in errors.items()}


def test_timed_up_and_go_of_twelve_people() -> None:
    rows, worst, worst_total = [], 0.0, 0.0
    for segment in WORN:
        by_patient = {patient: tug_errors(segment, patient) for patient in PATIENTS}
        for name in (*PARTS, "total"):
            all_of = np.array([e for errors in by_patient.values() for e in errors[name]])
            rows.append(
                (segment, name, *(f"{x:+.3f}" for x in (all_of.mean(), all_of.std(), _largest(all_of))))
            )
            if name == "total":
                worst_total = max(worst_total, float(np.abs(all_of).max()))
            else:
                worst = max(worst, float(np.abs(all_of).max()))
    record(
        "Timed up and go",
        ("sensor", "part", "mean", "sd", "largest"),
        rows,
        f"Twelve virtual people ({len(SEEDS)} takes each, turns to both sides), one sensor on skin, noise: "
        "found − true duration, s. Limits: segments 0.2 s, total 0.1 s. The truth is the exact motion by the "
        "same definition (docs/science/timed-tests.md).",
    )
    assert worst <= 0.2
    assert worst_total <= 0.1


@pytest.mark.parametrize(
    ("place", "segment"), [("upper_back", "chest"), ("lower_back", "chest"), ("hip", "pelvis")]
)
def test_a_real_person_sits_down_and_rises(place: str, segment: Segment) -> None:
    """qmt_fullbody: down at 44 to 52 s of its clock, up at 79 to 95 s; bows are neither."""
    changes = find_changes(follow_trunk(take(((segment, place),))))
    down, rise = changes
    assert (down.kind, rise.kind) == ("stand_to_sit", "sit_to_stand")
    assert 44.0 <= CLOCK_S + down.start_s < CLOCK_S + down.end_s <= 52.0
    assert 79.0 <= CLOCK_S + rise.start_s < CLOCK_S + rise.end_s <= 95.0


def test_turns_of_daily_life() -> None:
    """mobgap_lowback, two minutes of daily life: every turn of 45° seen by the cameras, no extras.

    Cameras see turns only within their walks and may truncate them; angles are compared for complete ones.
    """
    motion = follow_trunk(uniform(("Test11", "Trial1")))
    turns = find_turns(motion.yaw_rate, motion.valid, motion.rate_hz)
    walks, reference = turns_of(("Test11", "Trial1"))
    observations = [t for t in reference if abs(t.angle_deg) >= 45.0]
    off = []
    for turn in observations:
        same = [f for f in turns if f.start_s < turn.end_s and turn.start_s < f.end_s]
        same = [f for f in same if f.angle_rad * turn.angle_deg > 0.0]
        assert len(same) == 1, turn
        if turn.whole:
            off.append(float(np.degrees(abs(same[0].angle_rad))) - abs(turn.angle_deg))
    inside = [f for f in turns if any(a <= f.start_s and f.end_s <= b for a, b in walks)]
    matched = [f for f in inside if any(t.start_s < f.end_s and f.start_s < t.end_s for t in reference)]
    assert len(matched) == len(inside)
    record(
        "Turns of mobgap_lowback",
        ("turns of 45° and more", "found", "too many", "angle, median of the difference °", "largest °"),
        [
            (
                str(len(observations)),
                str(len(observations)),
                "0",
                f"{np.median(off):+.0f}",
                f"{_largest(np.array(off)):+.0f}",
            )
        ],
        "One older adult, two minutes of daily life; the reference is stereophotogrammetry inside its walks. "
        "Angles of turns that it saw whole. INDIP, the other reference, has five turns where it has nine.",
    )


@pytest.mark.parametrize("walk", ["11-1", "11-2"])
def test_ten_metres_of_a_real_lane(walk: str) -> None:
    """ipol_walks: a lane of 10 m; six of them are timed, and as fast as the strides say."""
    recording = replace(ipol_recording(walk, "foot_l", "foot_r", "pelvis"), protocol="walk_10m")
    analysis = analyse(recording)
    got = {p.name: p.mean for p in analysis.parameters}
    assert got["walk_10m_distance_m"] == pytest.approx(6.0, abs=0.4)
    assert got["walk_10m_speed_mps"] == pytest.approx(got["gait_speed_mps"], rel=0.05)


def test_real_standing_is_measured_or_withheld() -> None:
    """neura_walk has 11 s of standing, too short; with a shorter limit its values are plausible."""
    pelvis = neura_walk().sensors["pelvis"]
    standing = replace(neura_walk(), sensors={"pelvis": pelvis})
    assert {p.reason for p in measure_sway(standing).parameters} == {"standing_too_short"}
    got = {p.name: p.mean for p in measure_sway(standing, None, SwayParams(shortest_s=8.0)).parameters}
    assert got["sway_rms_mps2"] is not None
    assert 0.01 < got["sway_rms_mps2"] < 0.5
    assert got["sway_centroid_frequency_hz"] is not None
    assert 0.1 < got["sway_centroid_frequency_hz"] < 2.0


def _largest(values: np.ndarray) -> float:
    return float(values[np.argmax(np.abs(values))])


def test_guided_tests_give_the_figures_of_the_file() -> None:
    """Twelve people live, in blocks of a tenth of a second, against the file of the whole take."""
    names = ("tug_duration_s", *(f"tug_{part}_s" for part in PARTS))
    apart: dict[str, list[float]] = {name: [] for name in names}
    late = []
    for patient in PATIENTS:
        simulation = simulate_tug(patient, SEEDS[0], setup=replace(ON_SKIN, worn=("pelvis",)))
        whole = synchronise(simulation.recording)
        file = measure_tug(follow_trunk(whole))
        *_, visible_rows, last = followed(whole, "tug")
        assert last.final, patient
        assert last.result is not None
        assert file.end_s is not None
        late.append(visible_rows.t_s - file.end_s)
        got, want = ({p.name: p.mean for p in x.parameters} for x in (last.result, file))
        for name in names:
            live, offline = got[name], want[name]
            assert live is not None, (patient, name)
            assert offline is not None, (patient, name)
            apart[name].append(live - offline)
    rows = [(name, f"{_largest(np.array(x)):+.3f}") for name, x in apart.items()]
    record(
        "Guided timed up and go",
        ("figure", "largest difference"),
        rows,
        "Live − file of the whole take, s, twelve virtual people, pelvis. The result was shown "
        f"{min(late):.1f} to {max(late):.1f} s after the end.",
    )
    assert max(abs(x) for values in apart.values() for x in values) <= 0.02


def test_guided_ten_metres_against_the_file() -> None:
    """A simulated walk of 16 m calibrates the live chain and is the test at once."""
    person, rows, worst = PATIENTS["healthy"], [], 0.0
    script = (Stand(6.0), Straight(16.0, person.step_m, person.step_s), Stand(8.0))
    for name in ("lower_body7", "feet_pelvis3"):
        setup = replace(ON_SKIN, worn=PRESETS[name])
        recording = replace(simulate(script, person.walker, 1, setup).recording, protocol="walk_10m")
        whole = synchronise(recording)
        online = OnlineSession(hello_of(whole), whole.subject, "walk_10m")
        for batch in batches(whole, 10):
            online.push(batch)
            view = online.guide_test()
        assert view is not None
        assert view.final
        assert view.result is not None
        file = analyse(recording).functional
        assert file is not None
        live, offline = (x.parameters[0].mean for x in (view.result, file))
        assert live is not None
        assert offline is not None
        apart = 100.0 * (live / offline - 1.0)
        worst = max(worst, abs(apart))
        rows.append((name, f"{live:.2f}", f"{offline:.2f}", f"{apart:+.1f}"))
    record(
        "Guided ten metres",
        ("sensors", "live m/s", "file m/s", "difference %"),
        rows,
        "One virtual person. Live, the strides are those of the live chain, calibrated on this walk.",
    )
    assert worst <= 2.0


@pytest.mark.parametrize(("place", "segment"), [("upper_back", "chest"), ("lower_back", "chest")])
def test_a_real_rise_starts_the_clock_and_sitting_down_does_not(place: str, segment: Segment) -> None:
    """qmt_fullbody, guided: quiet, down, quiet, up. The clock of the rise is that of the file."""
    real = take(((segment, place),))
    *_, rise = find_changes(follow_trunk(real))
    guided = GuidedTest("five_sit_to_stand", (segment,), real.rate_hz)
    phases: list[str] = []
    rises: set[int | None] = set()
    for block in blocks(real, 10):
        guided.push(block)
        view = guided.advance()
        rises.add(view.rises)
        if phases[-1:] != [view.phase]:
            phases.append(view.phase)
    assert phases == ["get_ready", "ready", "running", "get_ready", "ready", "running"]
    assert rises == {None, 0, 1}
    assert guided.view.start_s == pytest.approx(rise.start_s, abs=0.1)
