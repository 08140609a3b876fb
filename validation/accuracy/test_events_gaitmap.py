"""Contacts of the published pitch rule on gaitmap_foot against motion capture (docs/science/events.md).

The product's refined contacts: test_events_references.py.

Reference events cover straight strides only: extras are counted inside reference strides. One reference
stride of the left foot (samples 3359 to 3826) spans the turn and holds two real strides: the contact in its
middle counts as an extra here, the contact at its end as missed.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core import calibration, events, timeline
from sagittal.core.events.result import EventKind, GaitEvents, Strides
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.fusion.mahony import estimate_orientations
from tests.helpers.event_scoring import Score, match
from tests.helpers.gaitmap import COPIES, RATE, recording_of, reference_strides, resampled
from validation.figures import record, record_in_short

RATES = (204.8, 60.0, 100.0, 128.0)


@cache
def found(name: str, rate_hz: float) -> tuple[GaitEvents, Strides]:
    """Events and strides of the product's chain, with a manifest only."""
    recording = recording_of(resampled(name, rate_hz), rate_hz)
    calibrated = calibration.calibrate(timeline.synchronise(recording))
    orientations = estimate_orientations(calibrated)
    contacts = events.detect(orientations)
    return contacts, events.stride_list(contacts, orientations, calibrated.calibration.turning)


@cache
def reference(side: Side, kind: EventKind) -> tuple[float, ...]:
    """Motion-capture events of one foot, s."""
    columns = ("ic", "pre_ic") if kind == "ic" else ("tc",)
    return tuple(sorted({float(r[c]) / RATE for r in reference_strides(side) for c in columns}))


def score(contacts: GaitEvents, side: Side, kind: EventKind) -> tuple[Score, int]:
    """Score, and the number of extras inside the reference strides."""
    result = match(contacts.times(side, kind), reference(side, kind))
    spans = [(float(r["start"]) / RATE, float(r["end"]) / RATE) for r in reference_strides(side)]
    return result, sum(any(a <= t < b for a, b in spans) for t in result.extra)


@pytest.mark.parametrize("name", COPIES)
@pytest.mark.parametrize("rate_hz", RATES)
def test_contacts_agree_with_motion_capture(name: str, rate_hz: float) -> None:
    contacts, _ = found(name, rate_hz)
    for side in SIDES:
        for kind in ("ic", "tc"):
            result, extra = score(contacts, side, kind)
            assert abs(result.mean_ms) <= 25, (side, kind)
            assert result.sd_ms <= 15, (side, kind)
            assert result.missed <= 1, (side, kind)
            assert extra <= 1, (side, kind)


def test_both_mountings_of_the_same_sensors_give_the_same_contacts() -> None:
    aligned, turned = (found(name, RATE)[0].events for name in COPIES)
    assert [(e.side, e.kind) for e in aligned] == [(e.side, e.kind) for e in turned]
    assert np.allclose([e.time_s for e in aligned], [e.time_s for e in turned], atol=1e-3)


def stride_errors(name: str, rate_hz: float, side: Side) -> Floats:
    """Stride time of every counted stride with both contacts in the reference, found − reference, s."""
    _, strides = found(name, rate_hz)
    errors = []
    for s in strides.select_used(side):
        start, end = (match([t], reference(side, "ic"), 0.05).errors for t in (s.start_s, s.end_s))
        if len(start) and len(end):
            errors.append(float(end[0] - start[0]))
    return np.array(errors)


@pytest.mark.parametrize("rate_hz", RATES)
def test_stride_times_agree_within_ten_milliseconds(rate_hz: float) -> None:
    """Stride times, contact to contact, of the straight reference strides."""
    for side in SIDES:
        errors = stride_errors(COPIES[0], rate_hz, side)
        assert len(errors) >= 21
        assert abs(errors.mean()) <= 0.002
        assert np.abs(errors).mean() <= 0.010
        assert errors.std(ddof=1) <= 0.010


def test_turning_strides_are_set_aside() -> None:
    _, strides = found(COPIES[0], RATE)
    for side in SIDES:
        assert len(strides.select_used(side)) >= 21
        turned = [
            s for s in strides.strides if s.side == side and s.excluded_reason in ("turn", "incomplete")
        ]
        assert 2 <= len(turned) <= 5, "one turn in the middle, one at the end"


def test_write_down_the_stride_times() -> None:
    rows = []
    for rate_hz in RATES:
        for side in SIDES:
            e = 1e3 * stride_errors(COPIES[0], rate_hz, side)
            figures = (f"{e.mean():+.1f}", f"{e.std(ddof=1):.1f}", f"{np.abs(e).mean():.1f}")
            rows.append((f"{rate_hz:g}", side, str(len(e)), *figures, f"{np.abs(e).max():.0f}"))
    pair = 1e3 * np.concatenate([stride_errors(COPIES[0], RATE, side) for side in SIDES])
    record_in_short(
        "Stride time ms",
        "–",
        f"{pair.mean():+.1f} ± {pair.std(ddof=1):.1f} (n={len(pair)})",
        "gaitmap_foot, 1 person, against motion capture",
    )
    record(
        "Stride times on gaitmap_foot",
        ("rate Hz", "foot", "strides", "mean ms", "sd ms", "mean |error| ms", "largest ms"),
        rows,
        "Counted strides against motion capture, contact to contact. Limits: |mean| ≤ 2 ms, sd and mean"
        " |error| ≤ 10 ms. The mean of a walk is right to a fraction of a millisecond; its variability is"
        " overstated by the sd given here.",
    )


def test_write_down_the_figures() -> None:
    rows = []
    for name in COPIES:
        for rate_hz in RATES:
            contacts, _ = found(name, rate_hz)
            for side in SIDES:
                for kind in ("ic", "tc"):
                    r, extra = score(contacts, side, kind)
                    n = len(reference(side, kind))
                    row = (name, f"{rate_hz:g}", side, kind.upper(), f"{len(r.errors)}/{n}", str(extra))
                    rows.append((*row, f"{r.mean_ms:+.1f}", f"{r.sd_ms:.1f}"))
    record(
        "Contacts on gaitmap_foot",
        ("copy", "rate Hz", "foot", "event", "found", "extra", "mean ms", "sd ms"),
        rows,
        "Contacts of the published pitch rule."
        " Error is found − motion capture. Limits (docs/science/events.md): |mean| ≤ 25 ms, sd ≤ 15 ms, at"
        " most one missed and one extra inside reference strides. Rates other than 204.8 Hz are resampled."
        " The contact before the right foot's first foot-off is not reported by design. One left reference"
        " stride spans the turn and holds two strides: its inner contact counts as extra, its end as missed.",
    )
