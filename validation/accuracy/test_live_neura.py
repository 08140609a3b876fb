"""Live chain on neura_walk, sample by sample, against Vicon and offline results.

The chain is causal, except that its calibration uses the walk so far. Limits:
docs/science/real-recordings.md, "Limits", for any pipeline; results of a live set are listed next to them.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.body.corrected import correct_signals
from sagittal.core.body.erkf.filter import erkf_inputs, filter_block
from sagittal.core.body.erkf.live_erkf import live_params
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.live_still import StillnessDetector
from sagittal.core.body.tree import person_tree
from sagittal.core.events import detect_contacts
from sagittal.core.events.foot_movement import measure_foot_movements
from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import FOOT, SIDES, Floats, Side
from tests.helpers.gaitmap import RATE
from tests.helpers.live_walks import Run, recorded
from tests.helpers.neura import stride_errors_m, take
from tests.helpers.neura_angles import PLANES, Score, scores
from tests.helpers.walks import neura_walk
from validation.accuracy.test_gaitmap_strides import BODY, errors
from validation.accuracy.test_gaitmap_strides import take as gaitmap_take
from validation.figures import record, record_in_short

# right and left: standing zeroed, offset removed, r
LIMITS = {
    "hip_flexion": ((3.2, 3.8), (2.8, 3.7), (0.985, 0.983)),
    "knee_flexion": ((4.0, 6.3), (3.3, 4.8), (0.988, 0.976)),
    "ankle_dorsiflexion": ((3.0, 2.9), (2.7, 2.7), (0.97, 0.95)),
}
SPEC = {
    "hip_flexion": "2.5/2.7 · 2.1/2.7 · .993/.991",
    "knee_flexion": "3.0/5.3 · 2.4/3.7 · .993/.983",
    "ankle_dorsiflexion": "2.3/2.2 · 2.2/2.1 · .977/.964",
}
STRIDE_CM, STRIDE_SD_CM = 2.5, 1.5
EVENT_MS = 10.0
"""Largest difference between a contact told live and offline: the two filters pitch a foot a little apart."""

GAITMAP_SD_MM = 45.0


@cache
def run() -> Run:
    return recorded(neura_walk())


@cache
def scored() -> dict[str, Score]:
    return scores(run().angles_deg)[1]


def nearest(events: list[GaitEvent]) -> tuple[list[float], int]:
    """Time of each live contact minus that of the nearest offline one, ms; offline ones without any."""
    calibrated, orientations = take()
    offline = list(detect_contacts(orientations, motions=measure_foot_movements(calibrated)).events)
    apart = []
    for e in events:
        same = [x for x in offline if (x.side, x.kind) == (e.side, e.kind)]
        match = min(same, key=lambda x: abs(x.time_s - e.time_s))
        apart.append(1e3 * (e.time_s - match.time_s))
        offline.remove(match)
    return apart, len(offline)


def strides_cm(side: Side) -> Floats:
    return 100.0 * stride_errors_m(side, run().ankle(side))


def gaitmap_mm(side: Side, trailing: bool) -> Floats:
    """Errors of straight strides of a foot through the live filter, started in mid-walk as the take is."""
    calibrated, _ = gaitmap_take()
    mount = {FOOT[side]: calibrated.calibration.segments[FOOT[side]].R_segment_sensor}
    tree = person_tree(BODY, mount, (FOOT[side],))
    inputs = erkf_inputs(tree, *correct_signals(calibrated, (FOOT[side],)), RATE)
    if trailing:
        still = StillnessDetector(1, RATE).push(inputs.acc, inputs.gyr, inputs.valid)
        inputs = replace(inputs, contact=still[:, :, 0], still=still[:, :, 1])
    first = start_state(tree, inputs, live_params(), bias_age_s=calibrated.calibration.zero[0])
    return errors(filter_block(first, inputs, tree, live_params())[0].p[:, 0], side, RATE).straight


def test_live_angles_are_within_the_limits_of_any_pipeline() -> None:
    for name, (zeroed, removed, least) in LIMITS.items():
        for i, end in enumerate("rl"):
            result = scored()[f"{name}_{end}"]
            assert result.zeroed <= zeroed[i], (name, end)
            assert result.offset_removed <= removed[i], (name, end)
            assert result.r >= least[i], (name, end)


def test_live_contacts_are_those_of_the_whole_take() -> None:
    apart, missed = nearest(run().events)
    assert missed == 0
    assert max(abs(x) for x in apart) <= EVENT_MS


def test_live_strides_agree_with_vicon() -> None:
    for side in SIDES:
        e = strides_cm(side)
        assert len(e) == 5
        assert abs(e.mean()) <= STRIDE_CM
        assert e.std() <= STRIDE_SD_CM


@pytest.mark.parametrize("side", SIDES)
def test_a_rule_that_trails_costs_no_stride_on_gaitmap(side: Side) -> None:
    assert gaitmap_mm(side, trailing=True).std() <= GAITMAP_SD_MM


def test_write_down_the_figures() -> None:
    result = run()
    rows = []
    for plane in PLANES:
        for name in plane:
            pair = [scored()[f"{name}_{end}"] for end in "rl"]
            cells = [
                "/".join(f"{getattr(x, source):.1f}" for x in pair) for source in ("zeroed", "offset_removed")
            ]
            cells.append("/".join(f"{x.r:.3f}" for x in pair))
            limit = LIMITS.get(name)
            visible_text = "none"
            if limit is not None:
                forms = (".1f", ".1f", ".3f")
                visible_text = " · ".join(
                    "/".join(f"{x:{f}}" for x in p) for p, f in zip(limit, forms, strict=True)
                )
            rows.append([name.replace("_", " "), *cells, visible_text, SPEC.get(name, "")])
    apart, _ = nearest(result.events)
    strides = ", ".join(f"{s} {strides_cm(s).mean():+.1f} ± {strides_cm(s).std():.1f} cm" for s in SIDES)
    began = next(f for f in result.frames if f.stage == "running").t_s
    lone = "; ".join(
        f"{s} {gaitmap_mm(s, True).mean():+.0f} ± {gaitmap_mm(s, True).std():.0f} "
        f"(centred {gaitmap_mm(s, False).mean():+.0f} ± {gaitmap_mm(s, False).std():.0f})"
        for s in SIDES
    )
    means = [np.mean([scored()[f"{name}_{end}"].offset_removed for end in "rl"]) for name in PLANES[0]]
    record_in_short(
        "The same live",
        "–",
        " / ".join(f"{x:.1f}" for x in means),
        "neura_walk, 1 person, nothing smoothed",
    )
    record(
        "Live on neura_walk",
        [
            "angle, right/left",
            "standing zeroed °",
            "offset removed °",
            "r",
            "limits",
            "prototype",
        ],
        rows,
        f"Seven sensors, batches of ten samples; calibrated while walking ({began:.1f} s), then caught up. "
        "Nothing is smoothed. Straight strides against Vicon: "
        f"{strides} (limit {STRIDE_CM} ± {STRIDE_SD_CM}). {len(apart)} contacts, live − offline "
        f"{np.mean(apart):+.1f} ± {np.std(apart):.1f} ms, none missed (limit {EVENT_MS:g}). The live filter "
        f"on gaitmap_foot, mm, with the rule for stillness that trails: {lone}; limit of the SD "
        f"{GAITMAP_SD_MM:g}. That take begins in motion, so the chain itself cannot be calibrated on it.",
    )
