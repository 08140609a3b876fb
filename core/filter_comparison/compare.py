"""Entry point: several filters on an analysed recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.angles.measure import measure_angles
from sagittal.core.errors import EstimationError, Notice
from sagittal.core.events.result import Strides
from sagittal.core.filter_comparison.reference import (
    PlacedReference,
    compare_by_bland_altman,
    lean_and_course,
    measure_reference_angles,
    place_reference,
)
from sagittal.core.filter_comparison.result import (
    BlandAltman,
    FilterAgreement,
    FilterComparison,
    FilterRequest,
    ReferenceScores,
)
from sagittal.core.filter_comparison.run import Clock, FilterRun, prepare_signals, run_filter
from sagittal.core.filter_comparison.spread import (
    choose_samples,
    cut_into_cycles,
    pool_scores,
    score_between,
    spread_of_angles,
    spread_of_segment,
)
from sagittal.core.formats.orientation_table import OrientationTable
from sagittal.core.frames import SIDES, Bools, Floats, Segment
from sagittal.core.fusion.algorithms.choice import LABELS
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.message import Message
from sagittal.core.pipeline import Progress, TakeAnalysis
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.rest import Window

OWN_CHAIN: Final = "Sagittal, as analysed"
"""The product's own orientations, to which every filter is compared."""

FAR_CODE: Final = "far_from_others"
FAR: Final = float(np.radians(20.0))
"""Orientation against the median from which a filter is told to be far from the others (our choice)."""


def compare_filters(
    analysis: TakeAnalysis,
    strides: Strides,
    request: FilterRequest,
    progress: Progress,
    clock: Clock,
    reference: OrientationTable | None = None,
) -> FilterComparison:
    """Run filters on the sensors of an analysed recording and compare them.

    All use the same samples, alignment, initial state and strides: those of the analysis. A filter that
    cannot run or diverges is reported and omitted; the others are compared without it.

    Parameters
    ----------
    strides : of the analysis, including manual edits.
    clock : returns seconds; used to measure computing time.
    reference : orientations from another system.

    Raises
    ------
    EstimationError `nothing_calibrated`; `no_orientations` for squats; `no_filter_ran` if every filter
    failed. FormatError as `place_reference`.
    """
    calibrated, single, own = _require_orientations(analysis)
    recording = calibrated.recording
    keep = choose_samples(len(recording.t_s), recording.rate_hz)
    signals = prepare_signals(calibrated, single, magnetometer=request.magnetometer)
    signals = {s: x for s, x in signals.items() if s in own.q}
    compared = _Kept(
        recording.t_s[keep],
        recording.rate_hz / keep.step,
        calibrated.calibration.zero,
        {s: own.q[s][keep] for s in signals},
        {s: recording.sensors[s].valid[keep] for s in signals},
    )
    runs: dict[str, FilterRun] = {}
    for k, name in enumerate(dict.fromkeys(request.filters)):
        progress("filters", k / len(request.filters))
        runs[name] = run_filter(name, signals, recording.rate_hz, keep, clock)
    _check_any_ran(runs)
    progress("comparing", 1.0)
    angles = {name: compared.measure_angles(run.q).angles for name, run in runs.items() if run.q}
    chain_angles = compared.measure_angles(compared.chain)
    spreads, medians = _spread_segments(runs, compared)
    spreads |= spread_of_angles(list(angles.values()), chain_angles.angles)
    every: dict[str | None, Mapping[Segment, Floats]] = {None: compared.chain}
    every.update((name, run.q) for name, run in runs.items())
    scores = None
    if reference is not None:
        placed = place_reference(reference, analysis.source.segments, medians, compared.valid, compared.t_s)
        measured: dict[str | None, Mapping[str, Floats]] = {None: chain_angles.angles}
        measured.update(angles.items())
        scores = _score(reference, placed, every, measured, compared.valid, chain_angles.zero_offset)
    own_run = FilterRun(compared.chain, None, ())
    agreements = [_agree(name, run, medians, compared) for name, run in ((None, own_run), *runs.items())]
    return FilterComparison(
        request,
        compared.t_s,
        tuple(signals),
        {s: sum(x.side == s and x.excluded_reason is None for x in strides.strides) for s in SIDES},
        tuple(agreements),
        tuple(
            cut_into_cycles(name, n, sd, reach, compared.t_s, strides)
            for name, (sd, reach, n) in spreads.items()
            if np.isfinite(sd).any()
        ),
        scores,
        _tell(agreements),
        every,
        compared.valid,
    )


def _require_orientations(analysis: TakeAnalysis) -> tuple[CalibratedRecording, Orientations, Orientations]:
    """The calibrated recording, its single-sensor orientations, and the final ones of the analysis."""
    mounted = analysis.mounted
    calibrated = analysis.calibrated if mounted is None else mounted.calibrated
    single = analysis.fused if mounted is None else mounted.orientations
    own = analysis.orientations
    if calibrated is None or single is None or own is None:
        if analysis.legs is not None:
            raise EstimationError(
                "no_orientations",
                "Squats are analysed with a kinematic chain of the leg; filters can be compared on walks "
                "only.",
            )
        reason = "" if analysis.problem is None else f" {analysis.problem.message}"
        raise EstimationError(
            "nothing_calibrated", Message("No sensor in this trial is calibrated.{why}", why=reason)
        )
    return calibrated, single, own


def _check_any_ran(runs: Mapping[str, FilterRun]) -> None:
    if not any(run.q for run in runs.values()):
        first_message = next(run.told[0].message for run in runs.values())
        raise EstimationError(
            "no_filter_ran",
            Message("No filter produced a result. First error: {told}", told=first_message),
        )


@dataclass(frozen=True, eq=False)
class _Kept:
    """The recording at the samples used for the comparison.

    Parameters
    ----------
    zero : of joint angles. chain : segment → (m, 4) to W by the analysis. valid : segment → (m,).
    """

    t_s: Floats
    rate_hz: float
    zero: Window
    chain: Mapping[Segment, Floats]
    valid: Mapping[Segment, Bools]

    def measure_angles(self, q: Mapping[Segment, Floats]) -> JointAngles:
        """Joint angles of orientations at these samples, with the zero of the recording."""
        valid = {s: self.valid[s] for s in q}
        return measure_angles(Orientations(self.t_s, self.rate_hz, q, valid, "compared"), self.zero)


def _spread_segments(
    runs: Mapping[str, FilterRun], compared: _Kept
) -> tuple[dict[str, tuple[Floats, Floats, int]], dict[Segment, Floats]]:
    """Spread of inclination and heading by quantity: SD, range, number of filters; and their medians."""
    spreads: dict[str, tuple[Floats, Floats, int]] = {}
    medians = {}
    for s, near in compared.chain.items():
        rows = [run.q[s] for run in runs.values() if s in run.q]
        if rows:
            spread, medians[s] = spread_of_segment(s, np.stack(rows), near, compared.valid[s])
            spreads |= {name: (*pair, len(rows)) for name, pair in spread.items()}
    return spreads, medians


def _agree(
    name: str | None, run: FilterRun, medians: Mapping[Segment, Floats], compared: _Kept
) -> FilterAgreement:
    """One row of the table: RMS over all segments relative to the median and to the analysis."""
    by_median, by_own = (
        {
            s: score
            for s, q in run.q.items()
            if s in targets and (score := score_between(q, targets[s], compared.valid[s])) is not None
        }
        for targets in (medians, compared.chain)
    )
    notices = run.told
    to_median = pool_scores(list(by_median.values()))
    if name is not None and to_median is not None and to_median.total > FAR:
        message = Message(
            "{total:.0f}° from the median: far from the others. Exclude it to see the spread of the rest.",
            total=np.degrees(to_median.total),
        )
        notices = (*notices, Notice(FAR_CODE, message))
    label = OWN_CHAIN if name is None else LABELS[name]
    to_own = None if name is None else pool_scores(list(by_own.values()))
    return FilterAgreement(name, label, run.cost_us, to_median, to_own, by_median, notices)


def _tell(agreements: list[FilterAgreement]) -> tuple[Notice, ...]:
    """Notices on all filters, shown above the results."""
    missing = [a.label for a in agreements if a.to_median is None]
    far = [a.label for a in agreements if any(n.code == FAR_CODE for n in a.told)]
    notices = []
    if missing:
        notices.append(
            Notice(
                "filters_left_out",
                Message("No result (see the table for reasons): {missing}.", missing=", ".join(missing)),
            )
        )
    if far:
        notices.append(
            Notice(
                "filters_far",
                Message("Far from the others but included in the spread: {far}.", far=", ".join(far)),
            )
        )
    return tuple(notices)


def _score(
    table: OrientationTable,
    placed: PlacedReference,
    every: Mapping[str | None, Mapping[Segment, Floats]],
    angles: Mapping[str | None, Mapping[str, Floats]],
    valid: Mapping[Segment, Bools],
    zero_offset: Mapping[str, float],
) -> ReferenceScores:
    """RMS errors and Bland–Altman statistics of every filter, segment and joint angle in the reference."""
    is_known = {s: np.isfinite(q[:, 0]) & valid[s] for s, q in placed.q.items()}
    whole = {s: np.where(is_known[s][:, None], q, (1.0, 0.0, 0.0, 0.0)) for s, q in placed.q.items()}
    joints = measure_reference_angles(whole, is_known, zero_offset) if whole else {}
    scores, pairs = {}, []
    for name, q in every.items():
        common = [s for s in placed.q if s in q]
        by_segment = {s: score_between(q[s], whole[s], is_known[s]) for s in common}
        scores[name] = {s: score for s, score in by_segment.items() if score is not None}
        for s in common:
            values = zip(
                ("inclination", "heading"),
                lean_and_course(q[s]),
                lean_and_course(np.where(is_known[s][:, None], placed.q[s], np.nan)),
                strict=True,
            )
            pairs += [(name, f"{s}_{quantity}", mine, theirs) for quantity, mine, theirs in values]
        mine = angles.get(name, {})
        pairs += [(name, joint, mine[joint], x) for joint, x in joints.items() if joint in mine]
    found_pairs = (compare_by_bland_altman(*pair) for pair in pairs)
    agreement: tuple[BlandAltman, ...] = tuple(x for x in found_pairs if x is not None)
    notices = (*(replace(n, severity="info") for n in table.notices), *placed.notices)
    return ReferenceScores(
        table.source, placed.lag_s, placed.correlation, tuple(placed.q), scores, agreement, notices
    )
