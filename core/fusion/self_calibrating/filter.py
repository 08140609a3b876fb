"""The filter for any number of sensors: live in blocks of any length, or smoothed over a whole recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import Bools, Floats
from sagittal.core.fusion.self_calibrating import layout as at
from sagittal.core.fusion.self_calibrating.kernel import count_interval, run_forward, smooth_backward
from sagittal.core.fusion.self_calibrating.motion import average_backwards, judge_motion
from sagittal.core.fusion.self_calibrating.params import SelfCalibratingParams, make_weights
from sagittal.core.fusion.self_calibrating.start import start_from_first
from sagittal.core.message import Message

NOTHING: Final = (np.empty((0, 4)), np.empty((0, 6, 0)), np.empty((0, 0)), np.empty((0, 1)))


@dataclass(frozen=True, eq=False)
class SensorEstimates:
    """Calibration estimates for S sensors, at the last sample.

    Parameters
    ----------
    gyro_bias : (S, 3) rad/s. gyro_matrix : (S, 3, 3), scale and misalignment: rate = (1 − matrix)(reading −
        bias). acc_bias : (S, 3) m/s². gravity : (S,) m/s². acc_delay_s : (S,). shaken_bias : (S, 3)
        increase of the gyroscope bias under vibration, rad/s per g². hard_iron : (S, 3) in the
        magnetometer's unit, and mag_delay_s (S,); None without a magnetometer.
    orientation_covariance : (S, 3, 3) rad² of the rotation vector, world axes, from the estimate to the
        truth; heading is relative to the field at the start.
    """

    gyro_bias: Floats
    gyro_matrix: Floats
    acc_bias: Floats
    gravity: Floats
    acc_delay_s: Floats
    shaken_bias: Floats
    hard_iron: Floats | None
    mag_delay_s: Floats | None
    orientation_covariance: Floats


@dataclass(frozen=True, eq=False)
class SmoothedOrientations:
    """Orientations (n, S, 4) sensor to world smoothed over the whole recording, and the calibration at its
    end.
    """

    q: Floats
    estimates: SensorEstimates


class SelfCalibratingFilter:
    """Orientation of S sensors with estimated biases, gyroscope matrix, delays and local magnetic field.

    World: z up; y the horizontal field at the start, without a magnetometer an arbitrary heading. A result
    belongs to the end of its sample's interval. Non-finite samples are bridged: the orientation is held with
    increasing uncertainty; those of the magnetometer are ignored individually.

    Parameters
    ----------
    rate_hz : of the samples. sensors : S. magnetometer : whether blocks will contain a field. gyro_matrix :
        (S, 3, 3) estimate from earlier recordings of the same sensors (`SensorEstimates`), preferably their
        median; initial value, with the uncertainty `gyro_matrix_sd`.

    Raises
    ------
    ParameterError `rate_out_of_range`, `sensors_out_of_range`, `shape_mismatch`.
    """

    def __init__(
        self,
        rate_hz: float,
        sensors: int = 1,
        params: SelfCalibratingParams | None = None,
        *,
        magnetometer: bool,
        gyro_matrix: Floats | None = None,
    ) -> None:
        if not 10.0 <= rate_hz <= 5000.0:
            raise ParameterError(
                "rate_out_of_range",
                Message("The rate must be 10 to 5000 Hz, not {rate_hz:g}.", rate_hz=rate_hz),
            )
        if sensors < 1:
            raise ParameterError(
                "sensors_out_of_range",
                Message("At least one sensor is needed, not {sensors}.", sensors=sensors),
            )
        self.rate_hz, self.uses_magnetometer = rate_hz, magnetometer
        self._weights = make_weights(params or SelfCalibratingParams())
        size = at.WITH_MAG if magnetometer else at.WITHOUT_MAG
        self._x = np.zeros((sensors, at.STATE))
        self._x[:, 0] = 1.0
        if gyro_matrix is not None:
            if np.shape(gyro_matrix) != (sensors, 3, 3) or not np.isfinite(gyro_matrix).all():
                raise ParameterError(
                    "shape_mismatch",
                    Message("Expected gyroscope matrices ({sensors}, 3, 3).", sensors=sensors),
                )
            self._x[:, 14:23] = np.reshape(gyro_matrix, (sensors, 9))
        self._P = np.zeros((sensors, size, size))
        self._sums = np.zeros((sensors, at.SUMS))
        self._motion = np.zeros((sensors, at.MOTION))
        self._counters = np.zeros((sensors, at.COUNTERS), np.int64)
        self._ring = np.zeros((sensors, at.RING, at.RING_WIDTH))

    def advance(self, gyr: Floats, acc: Floats, mag: Floats | None = None) -> Floats:
        """Process the next samples; the result is independent of the division into blocks.

        Parameters
        ----------
        gyr, acc : (n, S, 3) rad/s, m/s². mag : (n, S, 3) in any unit, required if the filter uses one.

        Returns
        -------
        q (n, S, 4), sensor to world.

        Raises
        ------
        EstimationError `no_magnetometer`, `bad_shape`, `filter_diverged`.
        """
        gyr, acc, field = self._check(gyr, acc, mag)
        n, sensors = gyr.shape[1], len(gyr)
        q, dt = np.empty((sensors, n, 4)), 1.0 / self.rate_hz
        features, still = np.empty((n, at.JUDGED)), np.empty(n, np.bool_)
        raw, F, d, decay = NOTHING
        for s in range(sensors):
            judge_motion(self._motion[s], self._counters[s], gyr[s], acc[s], dt, features, still)
            run_forward(
                *self._state(s), gyr[s], acc[s], field[s], features, still, dt, self._weights,
                q[s], raw, F, d, decay, F, F,
            )  # fmt: skip
        return self._finish(q)

    def smooth(self, gyr: Floats, acc: Floats, mag: Floats | None = None) -> Floats:
        """Process a whole recording forward and backward; as `advance`, for a filter without samples so far.

        Raises
        ------
        ParameterError `not_at_start`; and those of `advance`.
        """
        if self._counters[:, at.C_MOTION].any():
            raise ParameterError("not_at_start", "The filter has seen samples; smooth with a new one.")
        gyr, acc, field = self._check(gyr, acc, mag)
        n, sensors, m = gyr.shape[1], len(gyr), self._P.shape[1]
        q, dt = np.empty((sensors, n, 4)), 1.0 / self.rate_hz
        interval = count_interval(dt)
        size = n // interval
        raw, F, d, decay = np.empty((n, 4)), np.empty((size, 6, m)), np.empty((size, m)), np.empty((size, 1))
        previous_P, predicted_P = np.empty((size, m, m)), np.empty((size, m, m))
        for s in range(sensors):
            features, still = _judge_both_ways(self._motion[s], self._counters[s], gyr[s], acc[s], dt)
            x, P, _, counters, _ = self._state(s)
            start_from_first(x, P, self._weights, dt, counters, gyr[s], acc[s], field[s])
            run_forward(
                *self._state(s), gyr[s], acc[s], field[s], features, still, dt, self._weights,
                q[s], raw, F, d, decay, previous_P, predicted_P,
            )  # fmt: skip
            smooth_backward(interval, raw, F, d, decay, previous_P, predicted_P, q[s])
        return self._finish(q)

    @property
    def estimates(self) -> SensorEstimates:
        """The current calibration estimates."""
        x = self._x
        uses = self.uses_magnetometer
        return SensorEstimates(
            x[:, 4:7].copy(),
            x[:, 14:23].reshape(-1, 3, 3).copy(),
            x[:, 10:13].copy(),
            x[:, 13].copy(),
            x[:, 23].copy(),
            x[:, 24:27].copy(),
            x[:, 27:30] * x[:, at.NORM, None] if uses else None,
            x[:, 33].copy() if uses else None,
            self._P[:, :3, :3].copy(),
        )

    def _state(self, s: int) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        return self._x[s], self._P[s], self._sums[s], self._counters[s], self._ring[s]

    def _check(self, gyr: Floats, acc: Floats, mag: Floats | None) -> tuple[Floats, Floats, Floats]:
        """The same signals (S, n, 3), contiguous per sensor."""
        if self.uses_magnetometer and mag is None:
            raise EstimationError(
                "no_magnetometer",
                "This filter was created with a magnetometer, but the block has no magnetic field.",
            )
        sensors = len(self._x)
        used = [v for v in (gyr, acc, mag if self.uses_magnetometer else None) if v is not None]
        shapes = {np.shape(v) for v in used}
        if len(shapes) != 1 or len(next(iter(shapes))) != 3 or next(iter(shapes))[1:] != (sensors, 3):
            raise EstimationError(
                "bad_shape",
                Message(
                    "Expected (n, {sensors}, 3) for every signal, got {shapes}.",
                    sensors=sensors,
                    shapes=shapes,
                ),
            )
        contiguous = [np.ascontiguousarray(np.swapaxes(np.asarray(v, np.float64), 0, 1)) for v in used]
        return (
            contiguous[0],
            contiguous[1],
            contiguous[2] if self.uses_magnetometer else np.empty((sensors, 0, 3)),
        )

    def _finish(self, q: Floats) -> Floats:
        if not np.isfinite(q).all():
            raise EstimationError("filter_diverged", "The orientation is not a number; check the signals.")
        return np.ascontiguousarray(np.swapaxes(q, 0, 1))


def smooth_orientations(
    gyr: Floats,
    acc: Floats,
    rate_hz: float,
    mag: Floats | None = None,
    params: SelfCalibratingParams | None = None,
) -> SmoothedOrientations:
    """Orientations of S sensors smoothed over a whole recording; parameters, errors as
    `SelfCalibratingFilter`.
    """
    run = SelfCalibratingFilter(rate_hz, np.shape(gyr)[1], params, magnetometer=mag is not None)
    return SmoothedOrientations(run.smooth(gyr, acc, mag), run.estimates)


def _judge_both_ways(
    u: Floats, counters: Floats, gyr: Floats, acc: Floats, dt: float
) -> tuple[Floats, Bools]:
    """Motion (n, 3) without lag, and rest (n,) detected from either end."""
    n = len(gyr)
    features, still, backward = np.empty((n, at.JUDGED)), np.empty(n, np.bool_), np.empty(n, np.bool_)
    judge_motion(u, counters, gyr, acc, dt, features, still)
    judge_motion(
        np.zeros(at.MOTION),
        np.zeros(at.COUNTERS, np.int64),
        np.ascontiguousarray(-gyr[::-1]),
        np.ascontiguousarray(acc[::-1]),
        dt,
        np.empty((n, at.JUDGED)),
        backward,
    )
    if n:
        for j in (at.J_SPEED_SQUARE, at.J_SLOW_SQUARE):
            average_backwards(features[:, j], dt)
    return features, still | backward[::-1]
