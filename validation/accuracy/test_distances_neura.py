"""Distances of the report on neura_walk against the same definitions applied to Vicon's ankles.

Strides, flats and formulas are the product's on both sides; only the paths of the feet differ. The distance
of the ankles while standing, that a therapist takes with a tape, is Vicon's. Six strides of one person,
where the walk starts and stops among them: a check of magnitude, no statistic.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.body.feet import FootTracks
from sagittal.core.frames import SIDES, SUFFIX, Floats, Side
from sagittal.core.parameters import gait_parameters, measure_distances
from sagittal.core.pipeline import TakeAnalysis, analyse
from tests.data import data_folder
from tests.helpers.neura import STRAIGHT
from tests.helpers.walks import neura_recording
from validation.figures import record

LIMIT_CM = {
    "stride_length_m": 2.5, "step_length_m": 5.0, "step_width_m": 4.0, "circumduction_m": 2.0,
}  # fmt: skip
"""Worst mean error. Stride: docs/science/real-recordings.md, "Limits"; the others are ours, reached + half: a
step and its width hang on the whole chain of seven sensors and on the standing posture."""


@cache
def analysis() -> TakeAnalysis:
    subject = replace(neura_recording().subject, standing_width_m=round(standing_width_m(), 2))
    return analyse(replace(neura_recording(), subject=subject))


def vicon_ankles() -> dict[Side, np.ndarray]:
    """Path (n, 3) of each ankle centre, m."""
    table = np.genfromtxt(data_folder("neura_walk") / "reference_angles.csv", delimiter=",", names=True)
    return {s: np.stack([table[f"ankle_{axis}_{SUFFIX[s]}_m"] for axis in "xyz"], axis=1) for s in SIDES}


def standing_width_m() -> float:
    p = vicon_ankles()
    return float(np.linalg.norm((p["left"] - p["right"])[300:1000, :2].mean(axis=0)))


@cache
def tracks() -> tuple[FootTracks, FootTracks]:
    """The product's paths of the feet and the same with Vicon's ankles."""
    ours = analysis().feet
    assert ours is not None
    p = {s: path[: len(ours.t_s)] for s, path in vicon_ankles().items()}
    return ours, replace(ours, p=p, source="vicon")


@cache
def figures() -> tuple[Mapping[str, Floats], Mapping[str, Floats]]:
    """Figures of the whole strides ahead, ours and Vicon's."""
    strides = analysis().strides
    assert strides is not None
    ahead = np.array([set(s.flags) <= STRAIGHT for s in strides.strides])
    ours, vicon = (measure_distances(strides, feet) for feet in tracks())
    return {n: x.values[ahead] for n, x in ours.items()}, {n: x.values[ahead] for n, x in vicon.items()}


def errors_cm(name: str) -> np.ndarray:
    ours, vicon = (source[name] for source in figures())
    result = 100 * (ours - vicon)
    return np.asarray(result[np.isfinite(result)])


def total_m(feet: FootTracks) -> float:
    strides, angles = analysis().strides, analysis().angles
    assert strides is not None
    assert angles is not None
    (way,) = (p for p in gait_parameters(strides, angles, None, feet) if p.name == "total_distance_m")
    assert way.mean is not None
    return way.mean


@pytest.mark.parametrize("name", LIMIT_CM)
def test_distances_agree_with_vicon(name: str) -> None:
    errors = errors_cm(name)
    assert len(errors) >= 5
    assert abs(errors.mean()) <= LIMIT_CM[name]


def test_the_way_walked_agrees_within_two_percent() -> None:
    ours, vicon = (total_m(feet) for feet in tracks())
    assert ours == pytest.approx(vicon, rel=0.02)


def test_write_down_the_figures() -> None:
    result = []
    for name, limit in LIMIT_CM.items():
        e = errors_cm(name)
        cells = [
            f"{100 * np.nanmean(figures()[1][name]):.0f}",
            f"{e.mean():+.1f} ± {e.std():.1f}",
            f"{np.abs(e).max():.1f}",
        ]
        result.append([name.removesuffix("_m").replace("_", " "), str(len(e)), *cells, f"{limit:g}"])
    ours, vicon = (total_m(feet) for feet in tracks())
    record(
        "Distances on neura_walk",
        ["figure", "strides", "Vicon, mean cm", "error mean ± SD cm", "largest cm", "limit of the mean cm"],
        result,
        "Whole strides ahead, a last short one into standing among them that the report does not count, "
        "against the same definitions on Vicon's ankles; ankles "
        f"{100 * standing_width_m():.0f} cm apart while standing are entered, without this there is no "
        f"width. Way walked {ours:.2f} m, Vicon {vicon:.2f} m; limit "
        "2 %.",
    )
