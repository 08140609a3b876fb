"""Turns and stops of the 22 ipol_walks against manual annotations.

Turn limits were annotated by the authors on the lower back. Half of the turn's height was chosen because a
low-pass filter preserves it, not on these data.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.frames import Floats, Segment
from sagittal.core.pipeline import analyse
from sagittal.core.simulate import simulate_scenario
from tests.helpers.ipol import FEET, WALKS, checked_events, first_s, ipol_analysis, ipol_recording
from validation.figures import record

WORN: dict[str, tuple[Segment, ...]] = {"lower back": ("pelvis",), "both feet": FEET}
EDGE_S = 0.2


def edge_errors(segments: str) -> Floats:
    """(walks, 2) begin and end of the turn minus those of the people, s."""
    errors = []
    for walk in WALKS:
        measured, off = (
            ipol_analysis(walk, *WORN[segments]).measured,
            first_s(ipol_recording(walk, *WORN[segments])),
        )
        assert measured is not None
        true = np.array(checked_events(walk).turn_s)
        result = [np.array((t.start_s, t.end_s)) + off for t in measured.turns]
        errors.append(min((t - true for t in result), key=lambda e: float(np.abs(e).max())))
    return np.array(errors)


def stops(segments: str) -> int:
    """Walks with a reported stop."""
    measureds = [ipol_analysis(walk, *WORN[segments]).measured for walk in WALKS]
    return sum(any(b.stops for b in m.bouts) for m in measureds if m is not None)


def test_a_turn_begins_and_ends_within_a_fifth_of_a_second() -> None:
    for segments in WORN:
        assert np.abs(edge_errors(segments)).max() < EDGE_S


def test_nobody_is_told_to_have_stopped() -> None:
    assert [stops(segments) for segments in WORN] == [0, 0]


def test_the_figures_are_in_the_document() -> None:
    rows = []
    for segments in WORN:
        e = edge_errors(segments)
        subjects = [w.split("-")[0] for w in WALKS]
        by_key = [e[[s == x for x in subjects]].mean(axis=0) for s in sorted(set(subjects))]
        rows.append([
            segments,
            *(f"{e[:, i].mean():+.2f} ± {e[:, i].std(ddof=1):.2f}" for i in range(2)),
            f"{np.diff(e, axis=1).mean():+.2f}",
            f"{np.abs(e).max():.2f}",
            f"{np.abs(by_key).max():.2f}",
            str(stops(segments)),
        ])  # fmt: skip
    record(
        "Turns and stops on ipol_walks",
        ("sensors", "begin s", "end s", "duration s", "greatest error s", "greatest mean of a person s",
         "walks with a stop told"),
        rows,
        "22 walks of four healthy adults, one turn each, nobody stops. Limits: every edge within 0.2 s, no "
        "stop.",
    )  # fmt: skip


@pytest.mark.parametrize("worn", [("foot_l", "foot_r"), ("pelvis",)])
def test_virtual_patients_stop_once_and_are_told_to(worn: tuple[Segment, ...]) -> None:
    for name in ("healthy_slow", "hemiparetic", "drop_foot", "parkinson", "antalgic", "elderly"):
        take = simulate_scenario(name, 3)
        retained = {d: s if s in worn else None for d, s in take.recording.segments.items()}
        measured = analyse(replace(take.recording, segments=retained)).measured
        assert measured is not None
        (stop,) = [s for b in measured.bouts for s in b.stops]
        middle = take.truth.stands[1]
        assert stop[0] < middle[0] + 0.5
        assert stop[1] > middle[1] - 0.5
