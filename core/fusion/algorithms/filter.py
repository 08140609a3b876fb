"""One published filter over any number of sensors, sample by sample or in blocks of any length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.errors import EstimationError, ParameterError, SignalError
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.engines import PREPARE, Prepared, Setting
from sagittal.core.fusion.algorithms.listed import BY_NAME, Algorithm
from sagittal.core.fusion.algorithms.parameters import AlgorithmGains
from sagittal.core.fusion.algorithms.vectors import level
from sagittal.core.message import Message
from sagittal.core.rotation import from_matrix, normalise, rotate

UPRIGHT: Final = 0.9
"""Share of the vertical along the sensor's x from which on z is the start's seed of heading instead."""


@dataclass(frozen=True, eq=False)
class RestMeans:
    """Means over a rest to initialise a filter: tilt and heading by TRIAD, norms, gyroscope bias.

    Parameters
    ----------
    acc, gyr : (S, 3) specific force in any unit, and rad/s. mag : (S, 3) in any unit, None without.
    """

    acc: Floats
    gyr: Floats
    mag: Floats | None = None

    @classmethod
    def over(cls, acc: Floats, gyr: Floats, mag: Floats | None = None) -> RestMeans:
        """Means of the samples (n, S, 3) of a rest; non-finite samples are ignored.

        Raises
        ------
        SignalError `bad_signal` if a sensor has none.
        """
        means = [None if x is None else _mean(x) for x in (acc, gyr, mag)]
        return cls(*means)  # type: ignore[arg-type]

    def find_start(self) -> tuple[Floats, Floats]:
        """Orientation (S, 4) sensor to world, and the unit field (S, 3) of the world, y north.

        Without a magnetometer the heading is that of a sensor axis, and the field is (0, 1, 0).

        Raises
        ------
        SignalError `bad_signal` without gravity, or if the field is vertical.
        """
        q, field = np.empty((len(self.acc), 4)), np.tile([0.0, 1.0, 0.0], (len(self.acc), 1))
        R = np.empty((3, 3))
        for s, up in enumerate(self.acc):
            seed = [0.0, 0.0, 1.0] if abs(up[0]) > UPRIGHT * np.linalg.norm(up) else [1.0, 0.0, 0.0]
            north = np.array(seed) if self.mag is None else np.ascontiguousarray(self.mag[s], np.float64)
            vertical = np.ascontiguousarray(up, np.float64)
            if not (np.linalg.norm(vertical) > 0.0 and level(vertical, north, R)):
                raise SignalError(
                    "bad_signal",
                    Message(
                        "Sensor {value} has no usable direction at rest; use another still period.", value=s
                    ),
                )
            q[s] = from_matrix(R)
            if self.mag is not None:
                v = rotate(q[s], north)
                # TRIAD leaves nothing to the east; rounding does
                field[s] = np.array([0.0, np.hypot(v[0], v[1]), v[2]]) / np.linalg.norm(v)
        return q, field


def _mean(x: Floats) -> Floats:
    is_finite = np.isfinite(x)
    count = is_finite.sum(axis=0)
    if (count == 0).any():
        raise SignalError("bad_signal", "A sensor has no sample at rest; use another still period.")
    return np.asarray(np.where(is_finite, x, 0.0).sum(axis=0) / count)


class FusionFilter:
    """A filter of the list, ready to run.

    Parameters
    ----------
    name : of `ALGORITHMS`. rate_hz : of the samples. means : initial conditions. params : gains, of the
        algorithm's class; None = its defaults. magnetometer : whether to use one; None = if `means` has it
        and the algorithm supports it.

    Raises
    ------
    ParameterError `no_such_algorithm`, `gain_out_of_range`. EstimationError `no_magnetometer` if the
    algorithm needs one.
    """

    def __init__(
        self,
        name: str,
        rate_hz: float,
        means: RestMeans,
        params: AlgorithmGains | None = None,
        *,
        magnetometer: bool | None = None,
    ) -> None:
        self.algorithm = find_algorithm(name)
        params = self.algorithm.gains() if params is None else params
        if type(params) is not self.algorithm.gains:
            raise ParameterError(
                "gain_out_of_range",
                Message(
                    "{label} takes {name__}, not {type}.",
                    label=self.algorithm.label,
                    name__=self.algorithm.gains.__name__,
                    type=type(params).__name__,
                ),
            )
        if not rate_hz > 0.0:
            raise ParameterError(
                "rate_out_of_range", Message("The rate must be above 0, not {rate_hz:g} Hz.", rate_hz=rate_hz)
            )
        used = means.mag is not None if magnetometer is None else magnetometer
        if self.algorithm.magnetometer == "needed" and not (used and means.mag is not None):
            raise EstimationError(
                "no_magnetometer",
                Message(
                    "{label} requires a magnetometer and none is available. Choose a filter that does not.",
                    label=self.algorithm.label,
                ),
            )
        self._uses_mag = used and means.mag is not None and self.algorithm.magnetometer != "unused"
        self._params, self._rate_hz = params, rate_hz
        self._rest = means if self._uses_mag else RestMeans(means.acc, means.gyr)
        self._acc_norm = np.linalg.norm(self._rest.acc, axis=1)[:, None]
        self._mag_norm = (
            np.ones(1) if self._rest.mag is None else np.linalg.norm(self._rest.mag, axis=1)[:, None]
        )
        q, self._field = self._rest.find_start()
        self._prepared = self._prepare(q)

    def _prepare(self, q: Floats) -> Prepared:
        # Madgwick's filter without a magnetometer is one of the list: its own gains are kept
        keeps_bias = self._uses_mag or self.algorithm.magnetometer == "unused"
        setting = Setting(self._params, self._rate_hz, q, self._field, keeps_bias)
        return PREPARE[self.algorithm.engine](self.algorithm.kind, setting)

    @property
    def q(self) -> Floats:
        """Orientations (S, 4) sensor to world after the last sample."""
        return self._prepared.state[:, :4].copy()

    @property
    def bias(self) -> Floats | None:
        """Gyroscope bias (S, 3) in rad/s relative to that of the rest; None if the filter has none."""
        offset = self._prepared.bias
        return None if offset is None else self._prepared.state[:, offset : offset + 3].copy()

    def reset(self, q: Floats) -> None:
        """Restart at orientations q (S, 4) sensor to world, in the frame of the rest's field."""
        q = np.ascontiguousarray(q, np.float64)
        if q.shape != (len(self._rest.acc), 4) or not (np.linalg.norm(q, axis=1) > 0.0).all():
            raise ParameterError(
                "shape_mismatch", Message("Expected orientations ({acc}, 4).", acc=len(self._rest.acc))
            )
        self._prepared = self._prepare(normalise(q))

    def step(self, gyr: Floats, acc: Floats, mag: Floats | None = None) -> Floats:
        """Orientations (S, 4) after one sample (S, 3) of each kind; see `advance`."""
        block = None if mag is None else np.asarray(mag)[None]
        return np.asarray(self.advance(np.asarray(gyr)[None], np.asarray(acc)[None], block)[0])

    def advance(self, gyr: Floats, acc: Floats, mag: Floats | None = None) -> Floats:
        """Orientations (n, S, 4) sensor to world after each sample of a block.

        Results are bit-identical for any division into blocks. Samples that are non-finite, or shorter than a
        tenth of the norm at rest, give no correction.

        Parameters
        ----------
        gyr, acc, mag : (n, S, 3) in the units of the rest; gyr in rad/s including its bias.

        Raises
        ------
        ParameterError `shape_mismatch`. EstimationError `no_magnetometer` if mag is used but not given;
        `filter_diverged`.
        """
        shape = (len(gyr), len(self._rest.acc), 3)
        if not self._uses_mag:
            mag = None
        elif mag is None:
            raise EstimationError(
                "no_magnetometer", "This filter was started with a magnetometer; provide its samples."
            )
        if any(x is not None and np.shape(x) != shape for x in (gyr, acc, mag)):
            raise ParameterError("shape_mismatch", Message("Expected samples of shape {shape}.", shape=shape))
        rate = np.ascontiguousarray(gyr - self._rest.gyr, np.float64)
        force = np.ascontiguousarray(acc / self._acc_norm, np.float64)
        field = np.full(shape, np.nan) if mag is None else mag / self._mag_norm
        field = np.ascontiguousarray(field, np.float64)
        out = np.empty((*shape[:2], 4))
        prepared = self._prepared
        prepared.run(rate, force, field, prepared.state, out)
        if not np.isfinite(prepared.state[:, :4]).all():
            raise EstimationError(
                "filter_diverged",
                Message(
                    "{label} has diverged: its covariance is no longer positive definite. Raise γ, or "
                    "reset the filter.",
                    label=self.algorithm.label,
                ),
            )
        return out


def find_algorithm(name: str) -> Algorithm:
    """The algorithm with this name.

    Raises
    ------
    ParameterError `no_such_algorithm`.
    """
    if name not in BY_NAME:
        raise ParameterError(
            "no_such_algorithm",
            Message("No algorithm '{name}'; `sagittal bench fusion --list` lists them.", name=name),
        )
    return BY_NAME[name]
