"""Quality of a recording on its common axis: values per sensor, warnings and one overall level with
reasons.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, Literal, get_args

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.frames import GRAVITY, Segment
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.core.quality.inspection import measure_losses
from sagittal.core.quality.signals import magnetic_share, measure_stream, saturation
from sagittal.core.quality.suspicion import list_suspicions
from sagittal.core.rotation import find_lengths
from sagittal.core.signals.recording import Recording, SensorSignals, UniformRecording
from sagittal.core.signals.rest import QuietParams, Window, find_rest_windows, find_runs, index_window

Level = Literal["good", "usable", "poor"]
"""Best first."""

Verdict = Literal["good", "warn", "bad"]
"""Of an estimator, as core/body/health.py gives it."""

OF_ONE_FOOT: Final = frozenset({"zero_velocity_refused_pct", "longest_moving_s", "climb_pct", "gap_s"})
"""Findings of an estimator about the path of one foot: no second sensor has a part in them."""

GAP_S: Final = 0.1
"""Longest stretch that the time axis fills, s (docs/science/timeline.md, "Parameters"). Shorter ones are not
told: at an end of the take a shift by a sensor's late clock leaves them, which is told itself."""


@dataclass(frozen=True)
class QualityParams:
    """Limits of the report.

    Parameters
    ----------
    saturated : fraction of samples at the range limit. magnetic : deviation of |m| from its norm at rest, and
        magnetic_share : fraction of samples above it (docs/science/quality.md, "Range", "Magnetic field").
    invalid_usable, invalid_poor : fraction of the recording without data of a sensor [our choice].
        interpolated : interpolated fraction [our choice].
    acc_floor, gyr_floor : m/s², rad/s; lower values cannot be range limits (±2 g, ±250 °/s: the narrowest
        settings of wearables).
    """

    saturated: float = 0.001
    magnetic: float = 0.10
    magnetic_share: float = 0.10
    invalid_usable: float = 0.01
    invalid_poor: float = 0.20
    interpolated: float = 0.02
    acc_floor: float = 1.9 * GRAVITY
    gyr_floor: float = float(np.radians(245.0))
    rest: QuietParams = field(default_factory=QuietParams)


@dataclass(frozen=True)
class SensorQuality:
    """One sensor of the recording; percentages 0 to 100, SI units.

    Parameters
    ----------
    rest_norm : median |acc| over the rest windows, m/s²; gravity_scale : that / 9.80665. None without rest.
    gyro_bias : norm of the mean rate at rest, rad/s. magnetic_pct : None without magnetometer or rest.
    saturated_at : value of the plateau or None.
    """

    segment: Segment
    device_id: str
    source: str
    rate_hz: float
    lost_pct: float
    longest_gap_s: float
    gaps: int
    interpolated_pct: float
    invalid_pct: float
    rest_norm: float | None
    gravity_scale: float | None
    gyro_bias: float | None
    acc_saturated_pct: float
    gyr_saturated_pct: float
    magnetic_pct: float | None

    def to_json(self) -> dict[str, object]:
        """Plain values; undefined ones are None."""
        return {
            "segment": self.segment,
            "device_id": self.device_id,
            "source": self.source,
            "rate_hz": round(self.rate_hz, 3),
            "lost_pct": round(self.lost_pct, 3),
            "longest_gap_s": round(self.longest_gap_s, 3),
            "gaps": self.gaps,
            "interpolated_pct": round(self.interpolated_pct, 3),
            "invalid_pct": round(self.invalid_pct, 3),
            "rest_norm_mps2": _rounded(self.rest_norm, 4),
            "gravity_scale": _rounded(self.gravity_scale, 5),
            "gyro_bias_rad_s": _rounded(self.gyro_bias, 6),
            "acc_saturated_pct": round(self.acc_saturated_pct, 3),
            "gyr_saturated_pct": round(self.gyr_saturated_pct, 3),
            "magnetic_pct": _rounded(self.magnetic_pct, 2),
        }


@dataclass(frozen=True)
class QualityReport:
    """Quality report attached to the results.

    Parameters
    ----------
    level : good, usable or poor; `reasons` explain why it is not good. rest : windows with all sensors at
        rest. notices : an error among them means that results would be wrong and stops the analysis.
    """

    level: Level
    reasons: tuple[str, ...]
    duration_s: float
    rate_hz: float
    sensors: Mapping[Segment, SensorQuality]
    rest: tuple[Window, ...]
    notices: tuple[Notice, ...]

    def to_json(self) -> dict[str, object]:
        """Plain values for analysis.json and the quality box."""
        return {
            "level": self.level,
            "reasons": list(self.reasons),
            "duration_s": round(self.duration_s, 3),
            "rate_hz": round(self.rate_hz, 3),
            "sensors": [s.to_json() for s in self.sensors.values()],
            "rest_s": [[round(a, 3), round(b, 3)] for a, b in self.rest],
            "notices": [n.to_json() for n in self.notices],
        }


def find_shown_level(level: Level, verdict: Verdict | None) -> Level:
    """The displayed level: the worse of signal quality and pose estimator health, None = none ran."""
    of_estimator: dict[Verdict | None, Level] = {"warn": "usable", "bad": "poor"}
    return max(level, of_estimator.get(verdict, "good"), key=get_args(Level).index)


def concern_paths_alone(bad: Collection[str]) -> bool:
    """Whether all bad findings of an estimator, given by name, concern the path of a single foot."""
    return bool(bad) and OF_ONE_FOOT.issuperset(bad)


def assess(
    recording: Recording,
    uniform: UniformRecording,
    params: QualityParams | None = None,
    working: Collection[Segment] | None = None,
) -> QualityReport:
    """Assess the sensors that are mapped to a segment.

    Parameters
    ----------
    recording : as read; units, signs and losses are assessed on the original samples. uniform : the same
        recording on the uniform axis. working : segments with a working sensor (core/quality/stuck.py), used
        for rest detection. None = all.
    """
    params = params or QualityParams()
    rests = find_rest_windows(uniform, params.rest, working)
    sensors: dict[Segment, SensorQuality] = {}
    notices: list[Notice] = [n for n in (*recording.notices, *uniform.notices) if n.severity == "error"]
    if not rests:
        notices.append(
            Notice(
                "no_rest",
                "The sensors were never all still for 1 s, so there is no reference standing posture. Ask "
                "the person to stand still for 3 to 5 s at the start.",
                severity="info",
            )
        )
    for segment, signals in uniform.sensors.items():
        quality, new_notices = _sensor(segment, signals, recording, uniform, rests, params)
        sensors[segment] = quality
        # of one that does not measure no unit, range or hole need be told beside that
        notices += new_notices if working is None or segment in working else []
    notices += _copies(recording)
    level, reasons = _level(sensors, [*uniform.notices, *notices], params)
    return QualityReport(
        level=level,
        reasons=reasons,
        duration_s=len(uniform.t_s) / uniform.rate_hz,
        rate_hz=uniform.rate_hz,
        sensors=MappingProxyType(sensors),
        rest=rests,
        notices=tuple(dict.fromkeys(notices)),
    )


def _sensor(
    segment: Segment,
    signals: SensorSignals,
    recording: Recording,
    uniform: UniformRecording,
    rests: tuple[Window, ...],
    params: QualityParams,
) -> tuple[SensorQuality, list[Notice]]:
    stream = recording.streams[signals.device_id]
    f = measure_stream(stream)
    notices = list_suspicions(signals.device_id, f, stream.acc, stream.quat)
    lost, longest = measure_losses(stream)
    gaps = find_runs(~signals.valid | signals.interpolated)
    norm, bias = _measure_rest(signals, uniform, rests)
    invalid = float(np.mean(~signals.valid))
    notices += _gap_notice(segment, signals, uniform, invalid, params)
    acc_share, acc_top = saturation(stream.acc, params.acc_floor)
    gyr_share, gyr_top = saturation(stream.gyr, params.gyr_floor) if stream.gyr is not None else (0.0, None)
    notices += _saturated(segment, "acceleration", acc_share, acc_top, "m/s²", params)
    notices += _saturated(segment, "angular rate", gyr_share, gyr_top, "rad/s", params)
    magnetic = (
        None
        if stream.mag is None or not f.still
        else magnetic_share(stream.mag, f.still_slice, params.magnetic)
    )
    notices += _tell_magnetic(segment, magnetic, params)
    quality = SensorQuality(
        segment=segment,
        device_id=signals.device_id,
        source=stream.source,
        rate_hz=stream.rate_hz,
        lost_pct=100 * lost,
        longest_gap_s=longest,
        gaps=len(gaps),
        interpolated_pct=100 * float(np.mean(signals.interpolated)),
        invalid_pct=100 * invalid,
        rest_norm=norm,
        gravity_scale=None if norm is None else norm / GRAVITY,
        gyro_bias=bias,
        acc_saturated_pct=100 * acc_share,
        gyr_saturated_pct=100 * gyr_share,
        magnetic_pct=None if magnetic is None else 100 * magnetic,
    )
    return quality, notices


def _measure_rest(
    signals: SensorSignals, uniform: UniformRecording, rests: tuple[Window, ...]
) -> tuple[float | None, float | None]:
    """Norms of the specific force and of the mean rate at rest, None without rest."""
    at_rest = np.zeros(len(uniform.t_s), np.bool_)
    for window in rests:
        at_rest[index_window(window, uniform.rate_hz)] = True
    at_rest &= signals.valid
    if not at_rest.any():
        return None, None
    norm = float(np.median(find_lengths(signals.acc[at_rest])))
    bias = float(np.linalg.norm(signals.gyr[at_rest].mean(axis=0)))
    return norm, bias


def _tell_magnetic(segment: Segment, magnetic: float | None, params: QualityParams) -> list[Notice]:
    if magnetic is None or magnetic <= params.magnetic_share:
        return []
    return [
        Notice(
            "magnetic_disturbed",
            Message(
                "The magnetic field at {segment} deviates from its value at rest in {magnetic:.0f} % of the "
                "samples (limit {magnetic_share:.0f} %). The magnetometer is not used for joint angles.",
                segment=segment,
                magnetic=100 * magnetic,
                magnetic_share=100 * params.magnetic_share,
            ),
            segment,
            severity="info",
        ),
    ]


def _gap_notice(
    segment: Segment, signals: SensorSignals, uniform: UniformRecording, invalid: float, params: QualityParams
) -> list[Notice]:
    holes = [h for h in find_runs(~signals.valid) if h[1] - h[0] >= GAP_S * uniform.rate_hz]
    if any(n.code == "unequal_lengths" and n.sensor == segment for n in uniform.notices):
        # that notice says what is missing before the sensor began and after it stopped
        holes = [h for h in holes if h[0] > 0 and h[1] < len(signals.valid)]
        invalid = sum(end - start for start, end in holes) / len(signals.valid)
    if not holes:
        return []
    start, end = max(holes, key=lambda h: h[1] - h[0])
    return [
        Notice(
            "gap",
            Message(
                f"{{segment}} has no data in {{holes}} {plural(len(holes), 'gap', 'gaps')} of at least "
                "{GAP_S:g} s, {invalid:.1f} % of the trial; the longest is {value:.2f} s. Angles "
                "there are missing and affected strides are excluded; heading is re-estimated "
                "from the straight walking that follows.",
                segment=segment,
                holes=len(holes),
                GAP_S=GAP_S,
                invalid=100 * invalid,
                value=(end - start) / uniform.rate_hz,
            ),
            segment,
            start / uniform.rate_hz,
            severity="warning" if invalid > params.invalid_usable else "info",
        )
    ]


def _saturated(
    segment: Segment, device_part: str, share: float, top: float | None, unit: str, params: QualityParams
) -> list[Notice]:
    if top is None:
        return []
    return [
        Notice(
            "saturated",
            Message(
                "The {what} of {segment} stays at {top:.1f} {unit} in {share:.2f} % of the samples "
                "(limit {saturated:.1f} %): its range is too small for this movement. Set a wider "
                "range.",
                what=device_part,
                segment=segment,
                top=top,
                unit=unit,
                share=100 * share,
                saturated=100 * params.saturated,
            ),
            segment,
            severity="warning" if share > params.saturated else "info",
        )
    ]


def _copies(recording: Recording) -> list[Notice]:
    """Notice on a stream with a second, unmapped id, which is not analysed."""
    mapped = {d for d, s in recording.segments.items() if s is not None}
    by_digest: dict[str, list[str]] = {}
    for device, stream in recording.streams.items():
        by_digest.setdefault(stream.digest, []).append(device)
    notices = []
    for group in by_digest.values():
        if len(group) < 2:
            continue
        used = [d for d in group if d in mapped]
        device_id = used[0] if used else None
        ids = "”, “".join(group)
        notices.append(
            Notice(
                "duplicate_stream",
                Message(
                    "Sensors “{ids}” hold identical samples (a copy under another id); none of them is "
                    "analysed.",
                    ids=ids,
                )
                if device_id is None
                else Message(
                    "Sensors “{ids}” hold identical samples (a copy under another id); only “{device_id}” "
                    "is analysed.",
                    ids=ids,
                    device_id=device_id,
                ),
                used[0] if used else group[0],
                severity="info",
            )
        )
    return notices


def _level(
    sensors: Mapping[Segment, SensorQuality], notices: list[Notice], params: QualityParams
) -> tuple[Level, tuple[str, ...]]:
    """Poor: wrong or missing signals; usable: with caveats; good: without."""
    poor = [n.message for n in notices if n.severity == "error"]
    usable = [n.message for n in notices if n.severity == "warning"]
    for s in sensors.values():
        if s.invalid_pct > 100 * params.invalid_poor:
            poor.append(
                Message(
                    "{segment} has no data for {invalid_pct:.0f} % of the trial.",
                    segment=s.segment,
                    invalid_pct=s.invalid_pct,
                )
            )
        if s.interpolated_pct > 100 * params.interpolated:
            usable.append(
                Message(
                    "{interpolated_pct:.1f} % of the samples of {segment} are interpolated.",
                    interpolated_pct=s.interpolated_pct,
                    segment=s.segment,
                )
            )
    level: Level = "poor" if poor else "usable" if usable else "good"
    return level, tuple(dict.fromkeys([*poor, *usable]))


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
