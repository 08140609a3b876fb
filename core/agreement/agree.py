"""Consistency checks between sensors, and the recording with correctable errors corrected."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sagittal.core.agreement.exchange import SensorExchange, find_exchange, undo_exchange
from sagittal.core.agreement.joints import list_worn_joints
from sagittal.core.agreement.lags import SensorDrift, SensorLag, find_drifts, find_sensor_lags, list_judged
from sagittal.core.agreement.params import AgreementParams, JointParams, SlipParams
from sagittal.core.agreement.repair import leave_out, take_lag_out, turn_back
from sagittal.core.agreement.slips import SensorSlip, find_slips
from sagittal.core.agreement.standings import compare_standings
from sagittal.core.agreement.stride_slips import deny_slip, find_stride_slips
from sagittal.core.agreement.tell import tell_drift, tell_exchange, tell_lag, tell_left_over, tell_slip
from sagittal.core.agreement.terms import SensorTerms, find_terms
from sagittal.core.agreement.windows import JointWindows, compare_at_joint
from sagittal.core.errors import Notice
from sagittal.core.frames import Floats, Segment
from sagittal.core.quality.stuck import drop_stuck_sensors
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import Window
from sagittal.core.timeline import TimelineParams


@dataclass(frozen=True, eq=False)
class Agreement:
    """Result of the consistency checks on a recording, and of the corrections.

    Parameters
    ----------
    recording : corrected recording for all later stages, with notices. The input recording if nothing was
        detected.
    exchange : None with too few sensors. lags, drifts : all estimates, including those too small to be
        reported. slips : all of them are reported.
    whole : the same including the samples of a slipped sensor that `recording` excludes; None if none are
        excluded.
    shifted_s : sensor → corrected lag, at the middle of the recording, s.
    doubtful : sensor → period in which the adjacent angles must not be shown, s: around a corrected slip; the
        whole recording if the slip preceded the walk; otherwise from the slip on. Unless correction is
        disabled, an uncorrected sensor is invalid in that period.
    judged_clocks : sensors for which a lag would have been detected. judged_places : sensor → period in which
        a slip would have been detected, s.
    misfits : joint → median misfit of its two sides over its windows, after corrections.
    """

    recording: UniformRecording
    whole: UniformRecording | None = None
    exchange: SensorExchange | None = None
    lags: tuple[SensorLag, ...] = ()
    drifts: tuple[SensorDrift, ...] = ()
    slips: tuple[SensorSlip, ...] = ()
    shifted_s: Mapping[Segment, float] = field(default_factory=dict)
    doubtful: Mapping[Segment, Window] = field(default_factory=dict)
    judged_clocks: frozenset[Segment] = frozenset()
    judged_places: Mapping[Segment, Window] = field(default_factory=dict)
    misfits: Mapping[tuple[Segment, Segment], float] = field(default_factory=dict)


Terms = Mapping[Segment, SensorTerms]


def compare_sensors(
    recording: UniformRecording,
    params: JointParams,
    known_terms: Terms | None = None,
    unchanged: Iterable[JointWindows] = (),
    over_s: float = np.inf,
) -> tuple[tuple[JointWindows, ...], Terms]:
    """Windows of every joint with both sensors available, and the terms they were computed from.

    Parameters
    ----------
    known_terms : terms of unchanged sensors. unchanged : windows of joints with two unchanged sensors.
    over_s : terms are kept for this time from the first window on, for `find_exchange`; other terms are held
        only as long as the joints require them.
    """
    working = drop_stuck_sensors(recording)
    joints = list_worn_joints(working.sensors)
    known_terms, done = known_terms or {}, {(w.first, w.second): w for w in unchanged}
    order = (*known_terms, *sorted({s for joint in joints for s in joint} - set(known_terms)))
    terms, windows = dict(known_terms), []
    start = np.inf
    for i, joint in enumerate(joints):
        if joint not in done:
            for s in joint:
                if s not in terms or not terms[s].is_whole:
                    terms[s] = find_terms(working.sensors[s], working.rate_hz, params)
            done[joint] = compare_at_joint(joint, terms[joint[0]], terms[joint[1]], params)
        windows.append(done[joint])
        start = min(start, done[joint].start_s)
        needed = {s for later in joints[i + 1 :] if later not in done for s in later}
        for s in terms.keys() - needed:
            terms[s] = terms[s].keep_first(start + over_s)
    return tuple(windows), {s: terms[s].keep_first(start + over_s) for s in order}


def check_agreement(
    recording: UniformRecording,
    params: AgreementParams | None = None,
    timeline: TimelineParams | None = None,
) -> Agreement:
    """Detect swapped, late and slipped sensors, in this order, and correct them where possible.

    Parameters
    ----------
    recording : on the uniform axis. timeline : interpolation of samples between points of the axis.
    """
    params, timeline = params or AgreementParams(), timeline or TimelineParams()
    over_s = params.exchange.over_s
    joints, terms = compare_sensors(recording, params.joints, over_s=over_s)
    new_notices: list[Notice] = []
    if not joints:
        return _repair_slips(Agreement(recording), joints, terms, params.slips, new_notices)
    exchange = find_exchange(terms, joints, recording.rate_hz, params.joints, params.exchange)
    current = recording
    if exchange.mixed_up or exchange.mirrored:
        # what else the joints seem to say follows from that
        return Agreement(recording, exchange=exchange, misfits=measure_misfits(joints))
    if exchange.swap:
        new_notices.append(tell_exchange(exchange, params.exchange))
        if params.exchange.repair:
            current = replace(current, sensors=undo_exchange(exchange.swap, current.sensors))
            relabelled = undo_exchange(exchange.swap, terms)
            joints, terms = compare_sensors(current, params.joints, relabelled, over_s=over_s)
    clocks = list_judged(joints, params.lags)
    lags, drifts = find_sensor_lags(joints, params.lags), find_drifts(joints, params.lags)
    new_notices += [tell_lag(x, params.lags) for x in lags if x.told]
    new_notices += [tell_drift(x, params.lags) for x in drifts]
    late = _lags_over_time(current.t_s, lags, drifts) if params.lags.repair else {}
    if late:
        current = _take_lags_out(current, late, timeline)
        unchanged = {s: x for s, x in terms.items() if s not in late}
        same = [w for w in joints if not {w.first, w.second} & set(late)]
        joints, terms = compare_sensors(current, params.joints, unchanged, same, over_s)
        new_notices += [tell_left_over(x) for x in find_sensor_lags(joints, params.lags) if x.told]
    shifted = {s: float(x[len(x) // 2]) for s, x in late.items()}
    reached = Agreement(
        current, None, exchange, lags, drifts, (), shifted, {}, clocks, {}, measure_misfits(joints)
    )
    return _repair_slips(reached, joints, terms, params.slips, new_notices)


def _repair_slips(
    reached: Agreement,
    joints: Sequence[JointWindows],
    terms: Terms,
    params: SlipParams,
    new_notices: list[Notice],
) -> Agreement:
    """Find slipped sensors; correct or exclude them, and add `new_notices` to the recording."""
    current = reached.recording
    slips, places = _find_all_slips(current, terms, joints, params)
    by_strides, seen, slow = find_stride_slips(drop_stuck_sensors(current), {x.segment for x in slips})
    slips += by_strides
    places = {**seen, **places}
    new_notices += [tell_slip(x, params) for x in slips]
    new_notices += slow
    back = {x.segment: x for x in slips if x.is_repaired and params.repair}
    turned = {s: turn_back(current.sensors[s], current.t_s, x) for s, x in back.items()}
    doubtful = {x.segment: _find_doubt(x, x.segment in back) for x in slips}
    if new_notices:
        notices = tuple(dict.fromkeys((*current.notices, *new_notices)))
        current = replace(current, sensors={**current.sensors, **turned}, notices=notices)
    out = {s: x for s, x in doubtful.items() if params.repair and s not in back}
    left = {s: leave_out(current.sensors[s], current.t_s, x) for s, x in out.items()}
    whole, current = current, replace(current, sensors={**current.sensors, **left}) if left else current
    return replace(
        reached,
        recording=current,
        whole=whole if left else None,
        slips=slips,
        doubtful=doubtful,
        judged_places=places,
    )


def measure_misfits(joints: Iterable[JointWindows]) -> dict[tuple[Segment, Segment], float]:
    """Joint → median misfit of its two sides; joints without a window are omitted."""
    return {(j.first, j.second): float(np.median(j.residual)) for j in joints if len(j.t_s)}


def _find_all_slips(
    recording: UniformRecording, terms: Terms, joints: Sequence[JointWindows], params: SlipParams
) -> tuple[tuple[SensorSlip, ...], dict[Segment, Window]]:
    """Slips while walking and between two standing periods, in the form of `find_slips`."""
    slips, places = find_slips(recording, terms, joints, params)
    standing_slips, stayed = compare_standings(recording, terms, params)
    # a joint near the edge of a walk may blame its other sensor, which both standings then clear
    legs = {x.segment[-1] for x in standing_slips}
    slips = tuple(x for x in slips if x.segment[-1] not in legs or x.segment not in stayed)
    slips = tuple(x for x in slips if not deny_slip(recording, x))
    slips += tuple(x for x in standing_slips if x.segment not in {slip.segment for slip in slips})
    places |= {s: x for s, x in stayed.items() if s not in places or _length(x) > _length(places[s])}
    return slips, places


def _take_lags_out(
    recording: UniformRecording, late: Mapping[Segment, Floats], timeline: TimelineParams
) -> UniformRecording:
    shifted = {
        s: take_lag_out(recording.sensors[s], recording.t_s, x, recording.rate_hz, timeline)
        for s, x in late.items()
    }
    return replace(recording, sensors={**recording.sensors, **shifted})


def _length(window: Window) -> float:
    return window[1] - window[0]


def _find_doubt(slip: SensorSlip, repaired: bool) -> Window:
    if slip.at_rest:
        return -np.inf, np.inf
    return slip.at_s - slip.within_s, slip.at_s + slip.within_s if repaired else np.inf


def _lags_over_time(
    t_s: Floats, lags: Iterable[SensorLag], drifts: Iterable[SensorDrift]
) -> dict[Segment, Floats]:
    """Sensor → lag (n,) s at every sample, for corrected sensors."""
    late = {x.sensors[0]: np.full(len(t_s), x.lag_s) for x in lags if x.told and x.sure}
    for drift in drifts:
        middle, span = 0.5 * (drift.from_s + drift.until_s), max(drift.until_s - drift.from_s, 1e-9)
        late[drift.sensor] = late.get(drift.sensor, 0.0) + drift.change_s * (t_s - middle) / span
    return late
