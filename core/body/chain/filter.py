"""Joint angles of a chain from its sensors, sample by sample or for a whole recording.

Results are bit-identical for any division of the samples into blocks.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Final

import numpy as np

from sagittal.core.body.chain.kernel import (
    START_ACCELERATION,
    START_RATE,
    ChainArrays,
    ChainNoise,
    climb,
    filter_chain,
    make_scratch,
    predict_signals,
)
from sagittal.core.body.chain.model import RevoluteChain
from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import Bools, Floats
from sagittal.core.message import Message

START_STEPS: Final = 15
"""Steps of Gauss and Newton to the start; six are enough from 40°."""


@dataclass(frozen=True)
class ChainFilterParams:
    """Noise model of sensors and movement (docs/science/squat.md, "Parameters").

    Parameters
    ----------
    gyr_noise, acc_noise : rad/s, m/s², per sample, including model errors.
    jerk : rad/s³/√Hz of a joint. yaw : rad, of the virtual sensor that constrains hip rotation to zero.

    Raises
    ------
    ParameterError `parameter_out_of_range`.
    """

    gyr_noise: float = 0.02
    acc_noise: float = 0.3
    jerk: float = 8.5
    yaw: float = 0.2

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (isfinite(value) and value > 0.0):
                raise ParameterError(
                    "parameter_out_of_range",
                    Message("{name} = {value:g}; expected a number above 0.", name=name, value=value),
                )


@dataclass(frozen=True, eq=False)
class ChainMotion:
    """Angles, rates and the angles' standard deviations (n, J), rad, rad/s, rad."""

    angles: Floats
    rates: Floats
    sd: Floats


class ChainFilter:
    """One extended Kalman filter per sensor, each based on the estimates of those below it.

    Parameters
    ----------
    rest_force : (S, 3) mean specific force of the sensors in quiet standing, m/s². The filter starts in the
        pose determined by gravity, with all angles about the vertical zero.

    Raises
    ------
    ParameterError `rate_out_of_range`, `bad_shape`.

    References
    ----------
    Kianifar et al. 2019, "IMU-based pose estimation", doi:10.1177/2055668318813455; Lin and Kulić 2012,
    doi:10.1088/0967-3334/33/12/2099.
    """

    def __init__(
        self,
        chain: RevoluteChain,
        rate_hz: float,
        rest_force: Floats,
        params: ChainFilterParams | None = None,
    ) -> None:
        params = params or ChainFilterParams()
        if not 10.0 <= rate_hz <= 5000.0:
            raise ParameterError(
                "rate_out_of_range",
                Message("The rate must be 10 to 5000 Hz, not {rate_hz:g}.", rate_hz=rate_hz),
            )
        sensors = len(chain.places)
        force = np.asarray(rest_force, np.float64)
        if force.shape != (sensors, 3) or not np.isfinite(force).all():
            raise ParameterError(
                "bad_shape",
                Message(
                    "Expected a rest force of ({sensors}, 3), got {shape}.",
                    sensors=sensors,
                    shape=force.shape,
                ),
            )
        self._arrays = ChainArrays(
            axes=np.ascontiguousarray(chain.axes, np.float64),
            offsets=np.ascontiguousarray(chain.offsets, np.float64),
            first=np.array(chain.first, np.int64),
            places=np.ascontiguousarray(chain.places, np.float64),
            mounts=np.ascontiguousarray(chain.mounts, np.float64),
            base=np.ascontiguousarray(chain.base, np.float64),
            bounded=np.array(chain.bounded, np.bool_),
        )
        self._noise = ChainNoise(
            float(params.gyr_noise), float(params.acc_noise), float(params.jerk), float(params.yaw),
            1.0 / rate_hz,
        )  # fmt: skip
        size = 3 * int(np.diff(chain.first).max())
        self._x = np.zeros((len(chain.axes), 3))
        self._P = np.zeros((sensors, size, size))
        _stand(self._arrays, chain.start_sd, force, self._noise.acc, self._x, self._P)

    def advance(self, gyr: Floats, acc: Floats, valid: Bools | None = None) -> ChainMotion:
        """Process the next samples.

        Parameters
        ----------
        gyr, acc : (n, S, 3) bias-corrected rad/s, and m/s². valid : (n, S), None = all. During data loss of a
            sensor the joints of its group are held constant while their `sd` grows.

        Raises
        ------
        EstimationError `bad_shape`, `filter_diverged`.
        """
        gyr, acc = (np.ascontiguousarray(a, np.float64) for a in (gyr, acc))
        shape = (len(gyr), len(self._P), 3)
        is_valid = np.ones(shape[:2], np.bool_) if valid is None else np.ascontiguousarray(valid, np.bool_)
        if gyr.shape != shape or acc.shape != shape or is_valid.shape != shape[:2]:
            raise EstimationError(
                "bad_shape",
                Message(
                    "Expected gyr and acc of {shape}, got {shape2} and {shape3}, valid {shape4}.",
                    shape=shape,
                    shape2=gyr.shape,
                    shape3=acc.shape,
                    shape4=is_valid.shape,
                ),
            )
        if not (np.isfinite(gyr[is_valid]).all() and np.isfinite(acc[is_valid]).all()):
            raise EstimationError("filter_diverged", "A sample is not a number; mark it as invalid.")
        out = np.empty((shape[0], len(self._x), 3))
        broken = filter_chain(self._arrays, self._noise, self._x, self._P, gyr, acc, is_valid, out)
        if broken >= 0:
            raise EstimationError(
                "filter_diverged",
                "The chain filter diverged; check which segment each sensor is on.",
                t_s=broken * self._noise.step,
            )
        return ChainMotion(out[..., 0].copy(), out[..., 1].copy(), out[..., 2].copy())


def _stand(
    chain: ChainArrays, start_sd: Floats, force: Floats, acc_noise: float, x: Floats, P: Floats
) -> None:
    """Write the pose in which a chain at rest measures `force`, x (J, 3), and its covariance P (S, n, n)."""
    s = make_scratch(P.shape[1])
    base_motion = np.zeros((6, 3))
    base_motion[:3] = chain.base
    for i, measured in enumerate(force):
        a, b = int(chain.first[i]), int(chain.first[i + 1])
        n = 3 * (b - a)
        motion = np.empty((6, 3))
        prior = np.diag(1.0 / start_sd[a:b] ** 2)
        for _ in range(START_STEPS):
            climb(chain, i, x, base_motion, motion, n, s)
            predict_signals(motion, chain.places[i], chain.mounts[i], n, s)
            H = s.H[3:, :n:3]
            information = H.T @ H / acc_noise**2 + prior
            error = H.T @ (measured - s.h[3:]) / acc_noise**2 - prior @ x[a:b, 0]
            x[a:b, 0] += np.linalg.solve(information, error)
        P[i, :n:3, :n:3] = np.linalg.inv(information)
        for j in range(b - a):
            P[i, 3 * j + 1, 3 * j + 1] = START_RATE**2
            P[i, 3 * j + 2, 3 * j + 2] = START_ACCELERATION**2
        climb(chain, i, x, base_motion, motion, 0, s)
        base_motion = motion.copy()
