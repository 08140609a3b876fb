"""Parameters of whole analyses of few sensors against the truth of simulated people: is it within their ±?

Contacts, standing and calibration are those that the analysis finds itself, unlike in "L7S: levels and
ranges".
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np
import pytest

from sagittal.core.frames import SIDES, SUFFIX, Floats, Segment
from sagittal.core.parameters.catalogue import CurveFigure, list_curve_figures
from sagittal.core.parameters.uncertainty import ESTIMATED_DEG, FEET_ALONE_AT_CONTACT_DEG, FEET_ALONE_DEG
from sagittal.core.pipeline import analyse
from sagittal.core.simulate import simulate_scenario
from tests.helpers.l7s_walks import FLEXION
from validation.figures import record

PEOPLE: Final = (
    "healthy", "comfortable", "slow", "hemiparetic", "stiff_knee", "drop_foot", "antalgic", "elderly",
    "parkinson", "crouch",
)  # fmt: skip
SEED: Final = 5
WORN: Final[dict[str, tuple[Segment, ...]]] = {
    "pelvis and feet": ("pelvis", "foot_l", "foot_r"),
    "feet": ("foot_l", "foot_r"),
}
FIGURES: Final = {name: f for name, f in list_curve_figures().items() if f.variable in FLEXION}


@dataclass(frozen=True)
class Told:
    """A figure of one side: its error in ° and its ±, None where it is withheld."""

    name: str
    error: float | None
    uncertainty: float | None
    reason: str | None


def true_figure(angle: Floats, cycles: list[tuple[int, int]], figure: CurveFigure) -> float:
    """Mean over cycles (first and last sample) of a figure of the angle (n,) in °."""
    result = []
    for a, b in cycles:
        curve = np.interp(np.linspace(a, b, 101), np.arange(len(angle)), angle)
        part = curve[figure.start_pct : figure.end_pct + 1]
        read = {"at": part[0], "max": part.max(), "min": part.min(), "range": np.ptp(part)}
        result.append(read[figure.statistic])
    return float(np.mean(result))


@cache
def told(segments: str) -> tuple[Told, ...]:
    """All figures of all people."""
    return tuple(result for name in PEOPLE for result in of_person(name, segments))


def of_person(name: str, segment_names: str) -> Iterator[Told]:
    simulated = simulate_scenario(name, SEED)
    recording, truth = simulated.recording, simulated.truth
    segments = {d: s if s in WORN[segment_names] else None for d, s in recording.segments.items()}
    analysis = analyse(replace(recording, segments=segments))
    angles = truth.subtract_standing()
    for side in SIDES:
        cycles = [
            (round(100 * s.start_s), round(100 * s.end_s))
            for s in truth.strides
            if s.side == side and abs(s.turn_rad) < np.radians(10.0)
        ]
        by_name = {p.name: p for p in analysis.parameters if p.side == side}
        for figure, read in FIGURES.items():
            p = by_name[figure]
            true = true_figure(np.degrees(angles[f"{read.variable}_{SUFFIX[side]}"]), cycles, read)
            yield Told(figure, None if p.mean is None else p.mean - true, p.uncertainty, p.reason)


def stated(figure: str, segments: str) -> float:
    """Standard uncertainty of the leg model in °."""
    joint = FIGURES[figure].variable.partition("_")[0]
    reference = ESTIMATED_DEG if segments != "feet" else FEET_ALONE_DEG
    if segments == "feet" and FIGURES[figure].statistic == "at":
        reference = {**reference, **FEET_ALONE_AT_CONTACT_DEG}
    return reference[joint]


def by_figure(segments: str) -> dict[str, list[float]]:
    errors: dict[str, list[float]] = defaultdict(list)
    for t in told(segments):
        if t.error is not None:
            errors[t.name].append(t.error)
    return errors


@pytest.mark.parametrize("worn", WORN)
def test_every_estimated_figure_that_is_told_is_within_its_uncertainty(worn: str) -> None:
    reference = [t for t in told(worn) if t.error is not None and t.uncertainty is not None]
    assert len(reference) > 200
    assert all(abs(t.error or 0.0) < (t.uncertainty or 0.0) for t in reference)
    for name, errors in by_figure(worn).items():
        assert np.sqrt(np.mean(np.square(errors))) < stated(name, worn), name


@pytest.mark.parametrize("worn", WORN)
def test_what_is_withheld_says_why(worn: str) -> None:
    held = [t for t in told(worn) if t.error is None]
    assert {t.reason for t in held} <= {"at_bound"}
    assert {t.name for t in held} <= {"knee_flexion_min_stance_deg"}


def test_write_down_the_parameters() -> None:
    rows = []
    for segment_names in WORN:
        errors = by_figure(segment_names)
        for name in FIGURES:
            values = np.array(errors.get(name, []))
            held = sum(t.name == name and t.error is None for t in told(segment_names))
            cells = ["–"] * 3
            if len(values):
                rms = np.sqrt(np.mean(values**2))
                cells = [f"{values.mean():+.1f}", f"{rms:.1f}", f"{values[np.abs(values).argmax()]:+.0f}"]
            rows.append(
                [
                    segment_names,
                    name,
                    *cells,
                    f"{stated(name, segment_names):g}",
                    f"{held} of {2 * len(PEOPLE)}",
                ]
            )
    record(
        "L7S: parameters of whole analyses",
        ["sensors", "figure", "mean error °", "RMS °", "largest °", "stated °", "withheld"],
        rows,
        "Ten simulated people, each side by itself, against exact truth; contacts, standing and calibration "
        "are what the analysis of these sensors finds itself. Withheld: the knee rests on its bound there "
        "in most strides.",
    )
