"""Toe-out of four people over repeated walks: ipol_walks, from both feet alone.

No reference exists, but toe-out of a person hardly changes between walks, so differences mostly come from the
estimated anterior axes of the feet.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from sagittal.core.frames import SIDES, Floats, Side
from tests.helpers.ipol import FEET, SUBJECTS, WALKS, ipol_analysis
from validation.figures import record

SPREAD_DEG = 5.0


@cache
def toe_out(walk: str) -> dict[Side, float]:
    """Mean of a walk in degrees by side, where available."""
    parameters = ipol_analysis(walk, *FEET).parameters
    return {p.side: p.mean for p in parameters if p.name == "toe_out_deg" and p.side and p.mean is not None}


def of_subject(subject: str, side: Side) -> Floats:
    walks = [toe_out(w) for w in WALKS if w.startswith(subject)]
    return np.array([w[side] for w in walks if side in w])


def test_toe_out_of_a_person_repeats() -> None:
    spreads, rows = [], []
    for subject in SUBJECTS:
        each = [of_subject(subject, side) for side in SIDES]
        spreads += [x.std(ddof=1) for x in each]
        cells = [f"{x.mean():+.1f} ± {x.std(ddof=1):.1f}" for x in each]
        rows.append([subject, str(len(each[0])), *cells])
    rms = float(np.sqrt(np.mean(np.square(spreads))))
    rows.append(["all, RMS of the SD", "", f"{rms:.1f}", ""])
    record(
        "Toe-out from walk to walk on ipol_walks",
        ["subject", "walks", "left °", "right °"],
        rows,
        f"Mean ± SD between the walks of one person, each with its own standing. Limit of the RMS: "
        f"{SPREAD_DEG:g}°. With the forward axis from the velocity between two standings it was 7.2°.",
    )
    assert rms < SPREAD_DEG
