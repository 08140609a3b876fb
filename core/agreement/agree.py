"""What the sensors say about each other, and the recording with what could be repaired."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from core.agreement.joints import list_worn_joints
from core.agreement.lags import SensorDrift, SensorLag, find_drifts, find_sensor_lags
from core.agreement.params import AgreementParams, JointParams, LagParams
from core.agreement.repair import take_lag_out
from core.agreement.tell import tell_drift, tell_lag, tell_left_over
from core.agreement.terms import SensorTerms, find_terms
from core.agreement.windows import JointWindows, compare_at_joint
from core.frames import Floats, Segment
from core.quality.stuck import drop_stuck_sensors
from core.recording import UniformRecording
from core.timeline import TimelineParams


@dataclass(frozen=True, eq=False)
class Agreement:
    """What was found on a take, and what was made of it.

    Parameters
    ----------
    recording : what all that follows works on; its notices say what was found. The recording that was given
        when nothing had to be repaired.
    lags, drifts : as found, also where they are too small to be told. shifted_s : sensor → lag that was taken
        out, at the middle of the take, s.
    """

    recording: UniformRecording
    lags: tuple[SensorLag, ...] = ()
    drifts: tuple[SensorDrift, ...] = ()
    shifted_s: Mapping[Segment, float] | None = None


def compare_sensors(
    recording: UniformRecording, params: JointParams, known: Mapping[Segment, SensorTerms] | None = None
) -> tuple[tuple[JointWindows, ...], Mapping[Segment, SensorTerms]]:
    """Windows of every joint whose sensors are worn, and the terms they were made from.

    Parameters
    ----------
    known : terms of sensors that have not changed.
    """
    joints = list_worn_joints(recording.sensors)
    terms = dict(known or {})
    for segment in {s for joint in joints for s in joint} - set(terms):
        terms[segment] = find_terms(recording.sensors[segment], recording.rate_hz, params)
    return tuple(compare_at_joint((a, b), terms[a], terms[b], params) for a, b in joints), terms


def check_agreement(
    recording: UniformRecording,
    params: AgreementParams | None = None,
    timeline: TimelineParams | None = None,
) -> Agreement:
    """Find late clocks and take them out.

    Parameters
    ----------
    recording : on its axis. timeline : how samples between points of the axis are laid.
    """
    params, timeline = params or AgreementParams(), timeline or TimelineParams()
    worn = drop_stuck_sensors(recording)
    joints, terms = compare_sensors(worn, params.joints)
    lags, drifts = find_sensor_lags(joints, params.lags), find_drifts(joints, params.lags)
    late = _lags_over_time(recording.t_s, lags, drifts, params.lags)
    repaired = recording if not params.lags.repair else _shift(recording, late, timeline)
    notices = [tell_lag(x, params.lags) for x in lags if x.told]
    notices += [tell_drift(x, params.lags) for x in drifts]
    if repaired is not recording:
        unchanged = {s: x for s, x in terms.items() if s not in late}
        joints, terms = compare_sensors(drop_stuck_sensors(repaired), params.joints, unchanged)
        notices += [tell_left_over(x) for x in find_sensor_lags(joints, params.lags) if x.told]
    if not notices:
        return Agreement(recording, lags, drifts)
    told = replace(repaired, notices=(*repaired.notices, *dict.fromkeys(notices)))
    taken = {s: float(x[len(x) // 2]) for s, x in late.items()} if params.lags.repair else {}
    return Agreement(told, lags, drifts, taken)


def _lags_over_time(
    t_s: Floats, lags: Iterable[SensorLag], drifts: Iterable[SensorDrift], params: LagParams
) -> dict[Segment, Floats]:
    """Sensor → its lag (n,) s at every sample, of those that are repaired."""
    late: dict[Segment, Floats] = {}
    for lag in lags:
        if lag.told and lag.sure:
            late[lag.sensors[0]] = np.full(len(t_s), lag.lag_s)
    for drift in drifts:
        middle, span = 0.5 * (drift.from_s + drift.until_s), max(drift.until_s - drift.from_s, 1e-9)
        late[drift.sensor] = late.get(drift.sensor, 0.0) + drift.change_s * (t_s - middle) / span
    return late


def _shift(
    recording: UniformRecording, late: Mapping[Segment, Floats], timeline: TimelineParams
) -> UniformRecording:
    if not late:
        return recording
    shifted = {
        s: take_lag_out(recording.sensors[s], recording.t_s, x, recording.rate_hz, timeline)
        for s, x in late.items()
    }
    return replace(recording, sensors={**recording.sensors, **shifted})
