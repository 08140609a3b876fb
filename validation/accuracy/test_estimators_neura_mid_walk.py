"""neura_walk cut so that it begins mid-walk and only its end is at rest: nothing gets worse that matters.

The start is then tilt and heading from an orientation filter that ran back from the rest, velocity unknown,
gyroscope biases of the rest. Scored on the same rows of the walk as the uncut take, limits of
docs/science/real-recordings.md, "Limits", for flexion and strides; a shorter rest and fewer steps also
calibrate a little differently.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.calibration import calibrate
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.fusion.mahony import estimate_orientations
from tests.helpers.neura import RATE, Chain, chain, healthy, true_strides
from tests.helpers.neura_angles import reference
from tests.helpers.walks import cut, neura_walk
from validation.figures import record

CUTS_S = (11.6, 12.0, 12.5, 13.0)
ROWS = slice(1350, 2080)
LIMIT = {"hip_flexion": (2.8, 3.7), "knee_flexion": (3.3, 4.8), "ankle_dorsiflexion": (2.7, 2.7)}
"""Offset removed, right and left (docs/science/real-recordings.md, "Limits")."""

LAG = 1
"""Samples IMU behind Vicon, of the uncut take."""


@cache
def cut_at(start_s: float) -> Chain:
    recording = cut(neura_walk(), start_s, neura_walk().t_s[-1])
    calibrated = calibrate(recording)
    return chain(calibrated, estimate_orientations(calibrated))


def offset_removed(result: Chain, name: str, first: int) -> float:
    """RMSE of one angle against Vicon without its mean, degrees."""
    x = result.angles_deg[name][ROWS.start + LAG - first : ROWS.stop + LAG - first]
    return float(np.std(x - reference()[name][ROWS]))


def strides_cm(result: Chain, side: Side, first: int) -> Floats:
    """Errors of the straight strides within the cut trial."""
    p = result.ankle(side)
    return np.array(
        [
            100 * (np.linalg.norm((p[b - first] - p[a - first])[:2]) - length)
            for a, b, length in true_strides(side)
            if a >= first and b - first < len(p)
        ]
    )


def apart_mm(result: Chain) -> float:
    """RMS distance of the two ends of the worst joint."""
    return float(1000 * np.sqrt(np.mean(result.run.track.joint_residual**2, axis=0)).max())


@pytest.mark.parametrize("start_s", CUTS_S)
def test_flexion_and_strides_hold_from_a_start_mid_walk(start_s: float) -> None:
    result, first = cut_at(start_s), round(start_s * RATE)
    assert result.run.rest is None, "the take does not begin at rest"
    for name, limits in LIMIT.items():
        for end, limit in zip("rl", limits, strict=True):
            assert offset_removed(result, f"{name}_{end}", first) <= limit, f"{name} {end}"
    for side in SIDES:
        e = strides_cm(result, side, first)
        assert len(e) >= 3
        assert abs(e.mean()) <= 2.5
        assert e.std() <= 1.5
    assert apart_mm(result) <= 30.0


def test_write_down_the_figures() -> None:
    names = [*LIMIT, "hip_adduction", "knee_adduction"]
    rows = []
    for start_s, result in ((0.0, healthy()), *((s, cut_at(s)) for s in CUTS_S)):
        first = round(start_s * RATE)
        cells = [
            "/".join(f"{offset_removed(result, f'{n}_{end}', first):.1f}" for end in "rl") for n in names
        ]
        for side in SIDES:
            e = strides_cm(result, side, first)
            cells.append(f"{e.mean():+.1f} ± {e.std():.1f} ({len(e)})")
        rows.append(
            [
                f"{start_s:.1f} s" if start_s else "whole take",
                *cells,
                f"{apart_mm(result):.0f}",
            ]
        )
    record(
        "Start mid-walk on neura_walk",
        [
            "begins at", *(n.replace("_", " ") for n in names), "strides left cm", "strides right cm",
            "joints apart, RMS mm",
        ],
        rows,
        "RMSE offset removed in degrees, right/left, over the same 7 s. Walking begins at 11.3 s; the only "
        "rest of the cut takes is their last 3 s. Limits: flexion 2.8/3.7, 3.3/4.8, 2.7/2.7°, strides 2.5 ± "
        "1.5 cm, joints 30 mm.",
    )  # fmt: skip
