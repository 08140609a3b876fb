"""Ground truth as plain columns, named like the files of an analysis, SI units and radians.

Conversion to degrees and bytes is the responsibility of the server (a single place where degrees exist).
"""

from __future__ import annotations

from sagittal.core.frames import SIDES, Floats
from sagittal.core.simulate.truth import WalkTruth

Column = list[float] | list[float | None] | list[str]


def angle_table(truth: WalkTruth) -> dict[str, Floats]:
    """`t_s` and one column (n,) in rad per angle, relative to the truth in standing."""
    return {"t_s": truth.t_s, **truth.subtract_standing()}


def event_table(truth: WalkTruth) -> dict[str, Column]:
    """`time_s`, `side`, `kind` and `source` of all contacts in chronological order.

    Terminal contact has two rows: source "truth_release" (last touch) and "truth_lift5" (sole 5 mm up, which
    detectors and force plates come close to); compare detectors with the latter (docs/science/simulation.md,
    "Timing").
    """
    rows: list[tuple[float, str, str, str]] = []
    for side in SIDES:
        events = truth.contacts[side]
        rows += [(float(t), side, "ic", "truth") for t in events.contact]
        rows += [(float(t), side, "tc", "truth_release") for t in events.release]
        rows += [(float(t), side, "tc", "truth_lift5") for t in events.lift5 if t == t]
    rows.sort()
    return {
        "time_s": [r[0] for r in rows],
        "side": [r[1] for r in rows],
        "kind": [r[2] for r in rows],
        "source": [r[3] for r in rows],
    }


def stride_table(truth: WalkTruth) -> dict[str, Column]:
    """One row per true stride; `tc_s` is the 5 mm lift, `release_s` the last touch."""
    strides = truth.strides
    return {
        "side": [str(s.side) for s in strides],
        "start_s": [s.start_s for s in strides],
        "tc_s": [s.lift5_s for s in strides],
        "release_s": [s.release_s for s in strides],
        "end_s": [s.end_s for s in strides],
        "stride_length_m": [s.length_m for s in strides],
        "stride_width_m": [s.width_m for s in strides],
        "turn_rad": [s.turn_rad for s in strides],
    }
