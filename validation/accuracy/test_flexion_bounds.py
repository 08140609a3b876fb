"""Bounds on flexion error on neura_walk: reduction possible by constant changes of alignment.

The reference decides here, so these are not results of the product. Both segments' alignments are rotated for
the best agreement with Vicon, about the vertical alone (anterior axis), then freely. A gain then removes
errors proportional to flexion, such as skin movement or marker axes.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.angles.cardan import cardan_zxy
from sagittal.core.frames import FOOT, SHANK, SIDES, SUFFIX, THIGH, Floats, Segment, Side
from sagittal.core.rotation import conjugate, exp, multiply
from tests.helpers.neura import WALK, healthy
from tests.helpers.neura_angles import reference, scores
from validation.figures import record

JOINTS = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")
FREE = {"forward axes": (1, 4), "whole mountings": (0, 1, 2, 3, 4, 5)}
"""Turns (rad, segment axes) of the proximal and the distal segment that are set free."""


def beside(name: str, side: Side) -> tuple[Segment, Segment]:
    pairs: dict[str, tuple[Segment, Segment]] = {
        "hip_flexion": ("pelvis", THIGH[side]),
        "knee_flexion": (THIGH[side], SHANK[side]),
        "ankle_dorsiflexion": (SHANK[side], FOOT[side]),
    }
    return pairs[name]


@cache
def lag() -> int:
    return scores(healthy().angles_deg)[0]


def flexion(name: str, side: Side, turns: Floats) -> Floats:
    """Flexion (m,) in degrees while walking, both mountings turned by (6,) rad."""
    q = healthy().orientations.q
    proximal, distal = beside(name, side)
    part = slice(WALK.start + lag(), WALK.stop + lag())
    upper, lower = (multiply(q[s][part], exp(x)) for s, x in ((proximal, turns[:3]), (distal, turns[3:])))
    angle = np.degrees(cardan_zxy(multiply(conjugate(upper), lower))[:, 0])
    return -angle if name == "knee_flexion" else angle


def fit_turns(name: str, side: Side, free: tuple[int, ...]) -> Floats:
    """Error (m,) in degrees, its mean removed, with the turns that make it smallest."""
    from scipy.optimize import least_squares

    true = reference()[f"{name}_{SUFFIX[side]}"][WALK]

    def error(x: Floats) -> Floats:
        turns = np.zeros(6)
        turns[list(free)] = x
        off = (flexion(name, side, turns) - true + 180.0) % 360.0 - 180.0
        return np.asarray(off - off.mean())

    def residual(x: Floats) -> Floats:
        # the turn that a constant offset leaves free is held by a weak pull to nothing
        return np.concatenate((error(x), 1e-2 * x))

    result = least_squares(residual, np.zeros(len(free)))
    return error(result.x) if len(free) else error(np.zeros(0))


def leave_after_gain(error: Floats, true: Floats) -> float:
    """SD in degrees not explained by a share of the angle."""
    x = true - true.mean()
    return float(np.std(error - (error @ x) / (x @ x) * x))


def test_write_down_what_bounds_flexion() -> None:
    _, result = scores(healthy().angles_deg)
    rows = []
    for name in JOINTS:
        for side in reversed(SIDES):
            score, true = result[f"{name}_{SUFFIX[side]}"], reference()[f"{name}_{SUFFIX[side]}"][WALK]
            inputs = fit_turns(name, side, ())
            assert inputs.std() == pytest.approx(score.offset_removed, abs=0.05)
            best = [fit_turns(name, side, free) for free in FREE.values()]
            assert inputs.std() + 1e-6 >= best[0].std() >= best[1].std() - 1e-6
            left = leave_after_gain(best[0], true)
            rows.append(
                [
                    f"{name.replace('_', ' ')}, {side}",
                    *(f"{x:.1f}" for x in (score.raw, inputs.std(), *(e.std() for e in best), left)),
                ]
            )
    header = [
        "joint", "raw RMSE °", "offset removed °", "best forward axes °", "best whole mountings °",
        "best forward axes and a gain °",
    ]  # fmt: skip
    note = (
        "ErKF and smoother; mountings chosen by the reference, so these are bounds and no results. Raw less "
        "offset removed is the constant difference of two definitions of neutral."
    )
    record("What bounds flexion on neura_walk", header, rows, note)
