"""Reference walks for overlay on a replay: the norm at this speed, or one side's curves for both legs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.parameters.kinematic import cycle_curves, mean_curve
from sagittal.server.clinic.patients import Patient
from sagittal.server.results.comparisons import find_norms
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.server.viewer.ghost import match_reference
from sagittal.server.viewer.motion import GhostMotion, GhostName, ReplayMotion
from sagittal.server.viewer.reference import SAGITTAL, ReferenceWalk, add_standing_angles

Curves = Mapping[str, Floats]


def find_references(
    reviewed: ReviewedAnalyses, this: AnalysedSession, patient: Patient, motion: ReplayMotion
) -> dict[GhostName, Callable[[], GhostMotion | None]]:
    """Return name → function that computes the walk on first use; None if curves or strides are missing."""

    def match(curves: Curves, lead: Side) -> GhostMotion | None:
        if not all(name in curves for name in SAGITTAL):
            return None
        strides = reviewed.read_bundle(this.found, this.edits).strides
        return match_reference(motion, strides, ReferenceWalk(curves, motion.body, lead))

    @cache
    def find_norm() -> GhostMotion | None:
        norms = find_norms(patient, this.session, reviewed.read_numbers(this.found, this.edits))
        return match({name: np.radians(band.mean_deg) for name, band in norms.bands.items()}, "left")

    @cache
    def find_side(side: Side) -> GhostMotion | None:
        return match(_average_side(reviewed, this, side), side)

    left, right = SIDES
    return {"norm": find_norm, "left": lambda: find_side(left), "right": lambda: find_side(right)}


def _average_side(reviewed: ReviewedAnalyses, this: AnalysedSession, side: Side) -> Curves:
    """Mean curves of a side's included strides, rad, with standing angles added."""
    bundle = reviewed.read_bundle(this.found, this.edits)
    if bundle.angles is None:
        return {}
    cycles = cycle_curves(bundle.angles, bundle.strides)
    means = {name: mean_curve(cycles, name, side).mean for name in cycles.curves}
    finite = {name: x for name, x in means.items() if x is not None and np.isfinite(x).all()}
    return add_standing_angles(finite, bundle.angles.zero_offset, side)
