"""Flags and scores of virtual people by the whole chain, against the same on their exact truth.

Sensors on skin with shocks and MEMS errors. A goniometer reads the true standing angles to a whole degree.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
import pytest

from sagittal.core.flags import Flag, judge_flags
from sagittal.core.frames import Side
from sagittal.core.norms.scores import Scores, score_curves
from sagittal.core.parameters import cycle_curves
from sagittal.core.parameters.measure import MeasuredGait, measure_gait
from sagittal.core.parameters.result import CycleCurves
from sagittal.core.pipeline import analyse
from sagittal.core.simulate import simulate_scenario
from tests.helpers.true_walks import standing_width, true_tracks
from validation.figures import record

PEOPLE: Final = ("healthy", "hemiparetic", "stiff_knee", "drop_foot", "crouch")
HEIGHT_M: Final = 1.7

NEAR: Final = {"deg": 3.0, "": 0.08}
"""A value this near to its limit may fall on either side of it: the errors the values themselves are held to.
Degrees: joint angles (docs/science/real-recordings.md, "Limits"); ratios: contacts to 25 ms of a swing
(docs/science/events.md, "Limits on real walks")."""

SCORE_DEG: Final = 1.8
"""Largest error of gps_sagittal of a side; ours. Most of it is that a contact is refined to 20 ms after the
first touch of the simulator's sole: a curve begins 2 % of the cycle later (docs/science/events.md, "Simulated
feet"). Errors add to a score as squares, so they show most on the legs that are nearest the norm."""

Judged = tuple[dict[tuple[str, Side | None], Flag], Scores]


def _judged(curves: CycleCurves, source: MeasuredGait, standing: dict[str, float]) -> Judged:
    flags = judge_flags(curves, source.parameters, standing, HEIGHT_M)
    # a ratio has no fixed side: its own name is enough
    by_key = {(f.name, None if f.kind == "ratio" else f.side): f for f in flags}
    return by_key, score_curves(curves, standing)


@cache
def walk(name: str, seed: int = 5) -> tuple[Judged, Judged]:
    """By the truth and by the chain."""
    take = simulate_scenario(name, seed)
    truth = take.truth
    standing = {k: float(np.round(np.degrees(v))) for k, v in truth.zero_offset.items()}
    subject = replace(
        take.recording.subject, standing_width_m=standing_width(truth), standing_angles_deg=standing
    )
    run = analyse(replace(take.recording, subject=subject))
    assert run.measured is not None
    assert run.angles is not None
    assert run.angles.standing_deg == standing
    tracks = true_tracks(truth)
    perfect = measure_gait(tracks)
    assert tracks.angles is not None
    exact = {k: float(np.degrees(v)) for k, v in truth.zero_offset.items()}
    return (
        _judged(cycle_curves(tracks.angles, perfect.strides), perfect, exact),
        _judged(cycle_curves(run.angles, run.measured.strides), run.measured, standing),
    )


@pytest.mark.parametrize("name", PEOPLE)
def test_the_chain_raises_the_flags_of_the_truth(name: str) -> None:
    (true, _), (result, _) = walk(name)
    for key, flag in true.items():
        mine = result[key]
        if "sides_alike" in (flag.reason, mine.reason):
            # beyond the limit, and about as far apart as two sides are known to: said or left unsaid
            assert flag.value is not None
            assert mine.value is not None
            assert abs(mine.value - flag.value) <= NEAR[flag.unit], key
            continue
        if flag.exceeded is None or flag.value is None or flag.limit is None:
            assert mine.exceeded is None, key
            continue
        assert mine.value is not None, key
        if abs(flag.value - flag.limit) > NEAR[flag.unit]:
            assert mine.exceeded is flag.exceeded, (key, flag.value, mine.value, flag.limit)


def test_scores_are_near_those_of_the_truth() -> None:
    rows = []
    for name in PEOPLE:
        (by_truth, true), (by_chain, result) = walk(name)
        view = []
        for mode in ("raw", "offset_removed"):
            for side in ("left", "right"):
                a, b = (s.find("gps_sagittal_deg", mode, side).value for s in (result, true))
                assert a is not None
                assert b is not None
                assert abs(a - b) < SCORE_DEG, (name, mode, side)
                view.append(f"{a:.1f} / {b:.1f}")
        raised = [
            {f"{k[0]} {k[1] or ''}".strip() for k, f in by_key.items() if f.exceeded}
            for by_key in (by_truth, by_chain)
        ]
        pair = ", ".join(sorted(raised[0] & raised[1])).replace("_", " ") or "none"
        second = ", ".join(sorted(raised[0] ^ raised[1])).replace("_", " ") or "none"
        rows.append([name, *view, pair, second])
    record(
        "Scores and flags of virtual people",
        [
            "person",
            "raw left °",
            "raw right °",
            "shape left °",
            "shape right °",
            "flags of both",
            "of one only",
        ],
        rows,
        "gps_sagittal, chain / truth. Flags that only the chain or only the truth raises lie within 3° or "
        "0.08 of their limit, or the difference of their sides within its uncertainty. "
        f"Limit of the scores: {SCORE_DEG}°.",
    )
