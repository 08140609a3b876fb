"""Steps of one lower-back sensor against INDIP on mobgap_lowback, and against the feet on neura_walk.

Not fitted to these recordings, except that the Gaussian's scale is 64 ms at the step time of Test5
(docs/science/trunk-steps.md, "Parameters"); prominences of 0.15 to 0.4 m/s² give the same F1.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.events.lumbar import detect_steps
from sagittal.core.events.steps import Steps
from sagittal.core.frames import SIDES, Floats
from tests.helpers.event_scoring import Score, match
from tests.helpers.mobgap import TRIALS, Period, periods, uniform
from tests.helpers.walks import neura_walk, only
from validation.accuracy.test_events_neura import heel_stops
from validation.figures import record, record_in_short

WINDOW_S = 0.25
STOP_S = 1.3
"""Longer between two contacts is a stop, in the reference as in what is found."""


@cache
def found(trial: tuple[str, str]) -> Steps:
    return detect_steps(uniform(trial))


def inside(trial: tuple[str, str], period: Period) -> list[float]:
    """Steps found within a walking period of the reference."""
    low, high = period.start_s - WINDOW_S, period.end_s + WINDOW_S
    return [s.time_s for s in found(trial).steps if low <= s.time_s <= high]


def scores() -> list[tuple[tuple[str, str], Period, Score]]:
    return [
        (trial, p, match(inside(trial, p), p.contacts.tolist(), WINDOW_S))
        for trial in TRIALS
        for p in periods(trial)
    ]


def f1(results: list[Score]) -> float:
    hits = sum(len(r.errors) for r in results)
    return 2 * hits / (2 * hits + sum(len(r.extra) + r.missed for r in results))


def cadence(times: list[Floats]) -> float:
    """Steps a minute over all the walks, stops left out."""
    steps = np.concatenate([np.diff(t) for t in times])
    return 60.0 / float(np.mean(steps[steps < STOP_S]))


def test_steps_agree_with_the_insoles() -> None:
    assert f1([score for _, _, score in scores()]) >= 0.9
    for trial in TRIALS:
        assert f1([score for t, _, score in scores() if t == trial]) >= 0.9


def test_their_number_agrees_with_the_insoles() -> None:
    reference = sum(len(p.contacts) for _, p, _ in scores())
    assert abs(sum(len(inside(t, p)) for t, p, _ in scores()) - reference) <= 0.05 * reference


@pytest.mark.parametrize("trial", TRIALS)
def test_the_cadence_agrees_with_the_insoles(trial: tuple[str, str]) -> None:
    ours = cadence([np.array(inside(trial, p)) for p in periods(trial)])
    reference = cadence([p.contacts for p in periods(trial)])
    assert abs(ours / reference - 1.0) <= 0.05


def test_a_foot_that_is_told_is_the_right_one() -> None:
    is_reported = right = 0
    for trial, period, _ in scores():
        for step in found(trial).steps:
            nearest = int(np.argmin(np.abs(period.contacts - step.time_s)))
            if step.side is not None and abs(period.contacts[nearest] - step.time_s) <= WINDOW_S:
                is_reported += 1
                right += step.side == period.sides[nearest]
    assert is_reported >= 30
    assert right == is_reported


def test_the_feet_of_neura_walk_are_told_right() -> None:
    steps = detect_steps(only(neura_walk(), "pelvis")).steps
    heels = [(t, side) for side in SIDES for t in heel_stops(side)]
    is_reported = 0
    for step in steps:
        time, side = min(heels, key=lambda h: abs(h[0] - step.time_s))
        if step.side is not None and abs(time - step.time_s) <= WINDOW_S:
            is_reported += 1
            assert step.side == side
    assert is_reported >= 10


def test_every_walk_of_the_reference_is_in_a_bout() -> None:
    for trial in TRIALS:
        for p in periods(trial):
            covered = sum(
                max(0.0, min(b.end_s, p.end_s) - max(b.start_s, p.start_s)) for b in found(trial).bouts
            )
            assert covered >= 0.7 * (p.end_s - p.start_s), (trial, p.start_s)


def test_steps_of_the_pelvis_agree_with_the_heels_of_neura_walk() -> None:
    steps = detect_steps(only(neura_walk(), "pelvis"))
    heels = sorted(t for side in SIDES for t in heel_stops(side))
    result = match([s.time_s for s in steps.steps], heels, WINDOW_S)
    # one heel stops in the turn, out of step; two heels stop at one time when the walk closes
    assert len(result.errors) >= 11
    assert len(result.extra) <= 2


def test_write_down_the_figures() -> None:
    rows = []
    for trial in TRIALS:
        results = [score for t, _, score in scores() if t == trial]
        walks = periods(trial)
        total, reference = sum(len(inside(trial, p)) for p in walks), sum(len(p.contacts) for p in walks)
        errors = np.concatenate([r.errors for r in results])
        ours, theirs = (
            cadence([np.array(inside(trial, p)) for p in walks]),
            cadence([p.contacts for p in walks]),
        )
        sides = [s.side for s in found(trial).steps]
        rows.append(
            (
                " ".join(trial),
                f"{f1(results):.2f}",
                f"{total}/{reference}",
                f"{ours:.1f}/{theirs:.1f}",
                f"{1e3 * np.mean(errors):+.0f}",
                f"{1e3 * np.std(errors, ddof=1):.0f}",
                str(len(sides) - total),
                f"{len(sides) - sides.count(None)}",
            )
        )
    record_in_short(
        "Steps of one lower-back sensor: F1",
        "–",
        " / ".join(row[1] for row in rows),
        "mobgap_lowback, 1 person: two short walks, daily life",
    )
    record(
        "Steps of one lower-back sensor on mobgap_lowback",
        ("take", "F1", "steps/INDIP", "cadence/INDIP", "mean ms", "sd ms", "steps elsewhere", "foot told"),
        rows,
        "Against INDIP inside its walking periods, pairs within ±0.25 s. Limits: F1 ≥ 0.9 on every take, step"
        " count over all takes and cadence of each within 5 %, no foot told wrongly. Steps elsewhere are"
        " outside of the periods INDIP calls walking (the stereophotogrammetry has one more walk in Test11,"
        " and people step about between walks). Error is found − reference: the maximum of the vertical"
        " acceleration is later than the contact.",
    )
