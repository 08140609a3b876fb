"""Scores on neura_walk, from the sensor files alone, against the same scores of Vicon's curves.

Strides and definitions are the product's on both sides; only the curves differ. A goniometer is played by
Vicon: its mean angles while standing are entered as a therapist would enter them, whole degrees. Seven
strides of one person, where the walk starts and stops among them, each taken twice because so few have no
score: a check of magnitude, no statistic.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.events.result import Strides
from sagittal.core.frames import SIDES
from sagittal.core.norms.profile import NINE, SAGITTAL
from sagittal.core.norms.scores import Scores, score_curves
from sagittal.core.parameters import cycle_curves
from sagittal.core.parameters.result import CycleCurves
from tests.data import data_folder
from tests.helpers.neura import STRAIGHT
from tests.helpers.walks import neura_analysis
from validation.figures import record, record_in_short

WALK, STANDING = slice(1110, 2080), slice(300, 1000)
LAGS = range(-2, 7)
LIMIT_DEG = {"gps_sagittal raw": 1.5, "gps_sagittal shape": 1.5, "gps shape": 1.5}
"""Of each profile of a side; ours, reached (1.1 at most) + half."""

COURSE_DEG = {"pelvis_rotation": 1.5, "foot_progression": 3.0}
"""RMS of the mean curve; ours, reached (0.9, 2.0) + half."""

MARKERS = {"pelvis": ("LPSI", "RPSI"), "foot_l": ("LHEE", "LTOE"), "foot_r": ("RHEE", "RTOE")}
"""Two Vicon markers whose line over the floor turns with the segment."""


@cache
def vicon() -> JointAngles:
    """Vicon's angles, zero at anatomical, on our time axis; its markers' courses about the vertical."""
    from scipy.io import loadmat

    ours = neura_analysis().angles
    assert ours is not None
    n = len(ours.t_s)
    table = np.genfromtxt(data_folder("neura_walk") / "reference_angles.csv", delimiter=",", names=True)
    names = [name for name in table.dtype.names or () if name.endswith("_deg")]
    result = {name.removesuffix("_deg"): np.radians(table[name])[:n] for name in names}
    lag = min(
        LAGS,
        key=lambda k: sum(
            float(np.std((np.roll(ours.angles[f"{v}_{s}"], -k) - result[f"{v}_{s}"])[WALK]))
            for v in SAGITTAL
            for s in "lr"
        ),
    )
    file = data_folder("neura_walk") / "rawvicon" / "S02-Trial-Walk-1.mat"
    markers = loadmat(str(file), squeeze_me=True)
    courses = {}
    for segment, (a, b) in MARKERS.items():
        along = (markers[b] - markers[a])[:n]
        courses[segment] = np.roll(np.unwrap(np.arctan2(along[:, 1], along[:, 0])), lag)
    return JointAngles(ours.t_s, {k: np.roll(v, lag) for k, v in result.items()}, {}, headings=courses)


@cache
def curves() -> tuple[CycleCurves, CycleCurves]:
    """Ours from standing, Vicon's anatomical; Vicon has no pelvic tilt and obliquity: ours twice."""
    run = neura_analysis()
    assert run.angles is not None
    assert run.strides is not None
    retained = tuple(
        replace(s, excluded_reason=None) for s in run.strides.strides if set(s.flags) <= STRAIGHT
    )
    ours, true = (cycle_curves(angles, Strides(2 * retained)) for angles in (run.angles, vicon()))
    missing = {v: ours.curves[v] for v in ("pelvis_tilt", "pelvis_obliquity")}
    return ours, CycleCurves({**missing, **true.curves}, true.stride_index, true.used, true.foot_off_pct)


@cache
def goniometer() -> dict[str, float]:
    names = [f"{v}_{s}" for v in SAGITTAL for s in "lr"]
    return {n: float(np.round(np.degrees(vicon().angles[n][STANDING].mean()))) for n in names}


@cache
def found() -> tuple[Scores, Scores]:
    ours, true = curves()
    # Vicon's curves are anatomical as they are: a goniometer of zero
    return score_curves(ours, goniometer()), score_curves(true, dict.fromkeys(goniometer(), 0.0))


def test_scores_agree_with_those_of_vicon() -> None:
    ours, true = found()
    rows, worst = [], dict.fromkeys(LIMIT_DEG, 0.0)
    for label, name, mode in (
        ("gps_sagittal raw", "gps_sagittal_deg", "raw"),
        ("gps_sagittal shape", "gps_sagittal_deg", "offset_removed"),
        ("gps shape", "gps_deg", "offset_removed"),
    ):
        view = []
        for side in SIDES:
            a, b = (s.find(name, mode, side).value for s in (ours, true))  # type: ignore[arg-type]
            assert a is not None
            assert b is not None
            worst[label] = max(worst[label], abs(a - b))
            view.append(f"{a:.1f} / {b:.1f}")
        rows.append([label, *view, f"{LIMIT_DEG[label]:g}"])
        if label == "gps_sagittal raw":
            parts = [cell.split(" / ") for cell in view]
            record_in_short(
                "Sagittal score (GPS), left / right °",
                " / ".join(vicon for _, vicon in parts) + " (Vicon)",
                " / ".join(own for own, _ in parts),
                "neura_walk, 1 person, anatomical zero",
            )
    for variable in NINE[2:]:
        pairs = [
            [s.find("gvs_deg", "offset_removed", side, variable).value for s in (ours, true)]
            for side in SIDES
        ]
        rows.append([f"gvs {variable} shape", *(f"{a:.1f} / {b:.1f}" for a, b in pairs), "none"])
    record(
        "Scores on neura_walk",
        ["score °", "left, ours / Vicon", "right, ours / Vicon", "limit of the difference °"],
        rows,
        "Shape: offsets removed. Raw: Vicon's standing angles in whole degrees as goniometer. The shape of "
        "all nine takes our own pelvic tilt and obliquity on both sides, which Vicon's table does not have.",
    )
    for label, limit in LIMIT_DEG.items():
        assert worst[label] < limit, label


def test_rotation_and_progression_follow_vicon_over_the_stride() -> None:
    ours, true = curves()
    for variable, limit in COURSE_DEG.items():
        for side in SIDES:
            used = ours.used[side]
            error = np.degrees(ours.curves[variable][side][used] - true.curves[variable][side][used])
            assert np.sqrt(np.mean(error.mean(axis=0) ** 2)) < limit, (variable, side)
