"""Run any filter on the sensors of a calibrated recording, with the same kind of output: segment to W.

Every filter starts in the middle of the calibration's zero window, with the tilt and heading of the analysis,
and runs from there to both ends of the recording; backwards the rates are negated, which is the inverse
motion. A constant rotation about the vertical aligns its world with W. All later differences are due to the
filter.

A published filter rotates by a sample's rate from the previous sample to this one. The rate passed in is the
mean of both, as in the analysis: with the later one alone all filters lead by half a sample, 1.5° at 300 °/s
and 100 Hz.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core.errors import Notice, SagittalError
from sagittal.core.frames import Floats, Segment
from sagittal.core.fusion.algorithms.choice import OWN
from sagittal.core.fusion.algorithms.filter import FusionFilter, RestMeans
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.fusion.self_calibrating import SelfCalibratingFilter
from sagittal.core.rotation import about, conjugate, from_matrix, multiply, rotate, split_heading
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.rest import index_window

Clock = Callable[[], float]
"""Seconds of a clock that only goes forward; core has none of its own."""

BOTH_WAYS: Final = {o.name: o.both_ways for o in OWN}
WARM_UP: Final = 50
"""Samples of a first run that only loads what is compiled, so that it is not counted as cost."""


@dataclass(frozen=True, eq=False)
class MountedSignals:
    """Input of every filter for one sensor.

    Parameters
    ----------
    gyr, acc, mag : (n, 1, 3), NaN where the sensor was lost; mag None without a magnetometer. gyr is the rate
        from the previous sample to this one. rest : initial data of the filters, in the middle `at` of the
        zero window. start : (4,) sensor to W there.
    sensor_q : (4,) segment to sensor.
    """

    gyr: Floats
    acc: Floats
    mag: Floats | None
    rest: RestMeans
    at: int
    start: Floats
    sensor_q: Floats


@dataclass(frozen=True, eq=False)
class FilterRun:
    """One filter on all sensors: segment → (m, 4) segment to W at the compared samples, and notices on
    failures.
    """

    q: Mapping[Segment, Floats]
    cost_us: float | None
    told: tuple[Notice, ...]


def prepare_signals(
    calibrated: CalibratedRecording, single: Orientations, *, magnetometer: bool
) -> dict[Segment, MountedSignals]:
    """Signals and initial state of every calibrated sensor.

    Parameters
    ----------
    single : orientations of each sensor independently, with the same alignment.
    """
    recording, zero = calibrated.recording, calibrated.calibration.zero
    window = index_window(zero, recording.rate_hz)
    middle = min((window.start + window.stop) // 2, len(recording.t_s) - 1)
    prepared = {}
    for segment, mounted in calibrated.calibration.segments.items():
        signals = recording.sensors[segment]
        sensor = from_matrix(mounted.R_segment_sensor)
        q = multiply(single.q[segment], sensor)
        lost = ~signals.valid[:, None]
        acc, gyr = (np.where(lost, np.nan, x)[:, None] for x in (signals.acc, signals.gyr))
        gyr[1:] = 0.5 * (gyr[1:] + gyr[:-1])
        mag, north = None, None
        if magnetometer and signals.mag is not None:
            mag = np.where(lost, np.nan, signals.mag)[:, None]
            field = rotate(q[window], mag[window, 0])
            field = field[np.isfinite(field).all(axis=1)]
            # seen from the sensor in the middle: a walk that serves as zero turns it meanwhile
            north = rotate(conjugate(q[middle]), field.mean(axis=0))[None] if len(field) else None
        up = rotate(conjugate(q[middle]), np.array([0.0, 0.0, mounted.rest_norm]))
        means = RestMeans(up[None], mounted.gyro_bias[None], north)
        prepared[segment] = MountedSignals(
            gyr, acc, None if north is None else mag, means, middle, q[middle], conjugate(sensor)
        )
    return prepared


def run_filter(
    name: str,
    signals: Mapping[Segment, MountedSignals],
    rate_hz: float,
    keep: slice,
    clock: Clock,
) -> FilterRun:
    """Run one filter on every sensor; failures are reported by a notice for the segment.

    Parameters
    ----------
    keep : samples of the result.
    """
    q: dict[Segment, Floats] = {}
    notices, spent_s, samples = [], 0.0, 0
    orient = _orient_by_own if name in BOTH_WAYS else _orient_by_published
    for segment, x in signals.items():
        try:
            if not samples:
                orient(name, _first(x), rate_hz)
            began = clock()
            sensor = orient(name, x, rate_hz)
            spent_s += clock() - began
        except SagittalError as error:
            notices.append(Notice(error.code, error.message, segment))
            continue
        samples += len(x.gyr)
        _, turn = split_heading(multiply(x.start, conjugate(sensor[x.at])))
        q[segment] = multiply(multiply(about(2, turn), sensor[keep]), x.sensor_q)
    return FilterRun(q, 1e6 * spent_s / samples if samples else None, _join(notices, len(signals)))


def _orient_by_published(name: str, x: MountedSignals, rate_hz: float) -> Floats:
    """Sensor to the filter's world frame (n, 4), from the middle of the rest to both ends."""
    out = np.empty((len(x.gyr), 4))
    later, earlier = slice(x.at + 1, None), slice(x.at - 1, None, -1)
    run = FusionFilter(name, rate_hz, x.rest)
    out[x.at] = run.q[0]
    if x.at + 1 < len(out):
        out[later] = run.advance(x.gyr[later], x.acc[later], _part(x.mag, later))[:, 0]
    if x.at:
        # from a sample to the one before by the rate that led from that to this
        back = FusionFilter(name, rate_hz, RestMeans(x.rest.acc, -x.rest.gyr, x.rest.mag))
        rate = -x.gyr[1 : x.at + 1][::-1]
        out[earlier] = back.advance(rate, x.acc[earlier], _part(x.mag, earlier))[:, 0]
    return out


def _orient_by_own(name: str, x: MountedSignals, rate_hz: float) -> Floats:
    """The same with the self-calibrating filter, which needs no rest."""
    run = SelfCalibratingFilter(rate_hz, magnetometer=x.mag is not None)
    return np.asarray((run.smooth if BOTH_WAYS[name] else run.advance)(x.gyr, x.acc, x.mag)[:, 0])


def _first(x: MountedSignals) -> MountedSignals:
    """The first samples, with the initial state of the whole recording."""
    part = slice(0, WARM_UP)
    return replace(x, gyr=x.gyr[part], acc=x.acc[part], mag=_part(x.mag, part), at=0)


def _part(mag: Floats | None, part: slice) -> Floats | None:
    return None if mag is None else mag[part]


def _join(notices: list[Notice], sensors: int) -> tuple[Notice, ...]:
    """One notice for all segments with the same failure."""
    if len(notices) == sensors and len({(n.code, n.message) for n in notices}) == 1:
        return (Notice(notices[0].code, notices[0].message),)
    return tuple(notices)
