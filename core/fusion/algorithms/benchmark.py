"""Scores of filters on recordings with a reference orientation, as defined by the BROAD benchmark.

Laidig, Caruso, Cereatti and Seel 2021: the error q_ref ⊗ q* in the world is decomposed into a rotation about
the vertical (heading) and the rest (inclination); the score is the RMS over the movement phase.
"""

from __future__ import annotations

import hashlib
import zipfile
import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import Final

import numpy as np

from sagittal.core.errors import FormatError, SignalError
from sagittal.core.frames import Bools, Floats
from sagittal.core.fusion.algorithms.filter import FusionFilter, RestMeans
from sagittal.core.fusion.algorithms.parameters import AlgorithmGains
from sagittal.core.fusion.self_calibrating import SelfCalibratingFilter
from sagittal.core.message import Message
from sagittal.core.rotation import conjugate, multiply, split_heading

REST_S: Final = 1.0
"""Shortest rest before the movement that a filter is started from."""

_RATES: Final = (1.0, 1e5)
"""Hz of a trial; beyond it something else was written there."""
_UNREADABLE: Final = (
    # an array alone is no archive (TypeError); encrypted, or packed in a way that is not known (RuntimeError)
    KeyError, ValueError, TypeError, OSError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip

_NORM: Final = (0.9, 1.1)
"""Length of a unit quaternion; others are taken for lost."""

_SHAPES: Final = {"imu_gyr": 3, "imu_acc": 3, "imu_mag": 3, "opt_quat": 4}


@dataclass(frozen=True, eq=False)
class ReferenceTrial:
    """One sensor with an optical reference.

    Parameters
    ----------
    gyr, acc, mag : (n, 3) rad/s, m/s² and any unit, mag NaN if missing. reference : (n, 4) sensor to world,
        NaN where lost. moving : (n,) the phase to score.
    """

    name: str
    rate_hz: float
    gyr: Floats
    acc: Floats
    mag: Floats
    reference: Floats
    moving: Bools

    @property
    def scored(self) -> Bools:
        """Samples (n,) of the movement phase with a reference."""
        return np.asarray(self.moving & np.isfinite(self.reference).all(axis=1))

    @property
    def has_magnetometer(self) -> bool:
        """Whether there is any magnetometer sample."""
        return bool(np.isfinite(self.mag).any())

    @property
    def sha256(self) -> str:
        """Digest of the rate and all samples, independent of the file."""
        digest = hashlib.sha256(repr(self.rate_hz).encode())
        for array in (self.gyr, self.acc, self.mag, self.reference, self.moving):
            digest.update(array.tobytes())
        return digest.hexdigest()


@dataclass(frozen=True)
class OrientationScore:
    """RMS errors in rad."""

    total: float
    heading: float
    inclination: float


def read_trial(name: str, content: bytes) -> ReferenceTrial:
    """Read a trial of BROAD from the bytes of an .npz file.

    Raises
    ------
    FormatError `not_a_trial` if arrays are missing or have invalid contents.
    """
    try:
        with np.load(BytesIO(content), allow_pickle=False) as file:
            arrays = {key: np.asarray(file[key]) for key in (*_SHAPES, "movement", "sampling_rate")}
    except _UNREADABLE as error:
        raise FormatError(
            "not_a_trial",
            Message(
                "{name} does not hold imu_gyr, imu_acc, imu_mag, opt_quat, movement, sampling_rate.",
                name=name,
            ),
        ) from error
    if wrong := [key for key, array in arrays.items() if array.dtype.kind not in "fiub"]:
        raise FormatError(
            "not_a_trial", Message("{name}: {wrong} are no numbers.", name=name, wrong=", ".join(wrong))
        )
    n = arrays["movement"].size
    if (
        not n
        or arrays["movement"].shape != (n,)
        or any(arrays[k].shape != (n, d) for k, d in _SHAPES.items())
    ):
        raise FormatError(
            "not_a_trial", Message("{name}: arrays of different lengths, or without samples.", name=name)
        )
    rate = arrays["sampling_rate"]
    if rate.size != 1 or not _RATES[0] <= rate.item() <= _RATES[1]:
        raise FormatError(
            "not_a_trial",
            Message(
                "{name}: sampling_rate is one number of {RATES:g} to {RATES2:g} Hz.",
                name=name,
                RATES=_RATES[0],
                RATES2=_RATES[1],
            ),
        )
    gyr, acc, mag, reference = (np.array(arrays[key], np.float64, order="C") for key in _SHAPES)
    norm = np.linalg.norm(reference, axis=1)
    reference[(norm < _NORM[0]) | (norm > _NORM[1])] = np.nan
    return ReferenceTrial(name, float(rate.item()), gyr, acc, mag, reference, arrays["movement"].astype(bool))


def find_rest(trial: ReferenceTrial, *, with_bias: bool = False) -> RestMeans:
    """Means over the rest before the movement; `with_bias` keeps the gyroscope bias.

    Raises
    ------
    SignalError `no_rest` if it is shorter than a second.
    """
    first = int(np.argmax(trial.moving)) if trial.moving.any() else len(trial.moving)
    if first < REST_S * trial.rate_hz:
        raise SignalError(
            "no_rest",
            Message(
                "{name} has less than {REST_S:g} s of rest before the movement.",
                name=trial.name,
                REST_S=REST_S,
            ),
        )
    acc, gyr, mag = (x[:first, None] for x in (trial.acc, trial.gyr, trial.mag))
    means = RestMeans.over(acc, gyr, mag if trial.has_magnetometer else None)
    return RestMeans(means.acc, np.zeros((1, 3)), means.mag) if with_bias else means


def run_trial(
    name: str,
    trial: ReferenceTrial,
    params: AlgorithmGains | None = None,
    *,
    with_bias: bool = False,
    magnetometer: bool | None = None,
) -> Floats:
    """Orientations (n, 4) of a trial from one algorithm, initialised with the rest before the movement.

    Parameters
    ----------
    with_bias, magnetometer : as in `find_rest` and `FusionFilter`.
    """
    means = find_rest(trial, with_bias=with_bias)
    run = FusionFilter(name, trial.rate_hz, means, params, magnetometer=magnetometer)
    return run.advance(trial.gyr[:, None], trial.acc[:, None], trial.mag[:, None])[:, 0]


def run_own(trial: ReferenceTrial, *, both_ways: bool) -> Floats:
    """Orientations (n, 4) from the self-calibrating filter, which estimates its initial state and the bias
    itself.
    """
    signals = trial.gyr[:, None], trial.acc[:, None], trial.mag[:, None]
    run = SelfCalibratingFilter(trial.rate_hz, magnetometer=True)
    return np.asarray((run.smooth if both_ways else run.advance)(*signals)[:, 0])


def score_orientation(q: Floats, trial: ReferenceTrial) -> OrientationScore:
    """RMS errors of orientations (n, 4) over the movement phase with a reference."""
    part = trial.scored
    return score_error(multiply(trial.reference[part], conjugate(q[part])))


def score_error(error: Floats) -> OrientationScore:
    """RMS of errors (..., 4) in the world: reference ⊗ estimate*."""
    tilt, turn = split_heading(error)
    inclination = np.linalg.norm(tilt, axis=-1)
    # of half angles the cosines multiply
    total = 2.0 * np.arccos(np.clip(np.cos(0.5 * turn) * np.cos(0.5 * inclination), -1.0, 1.0))

    def rms(angle: Floats) -> float:
        return float(np.sqrt(np.mean(angle**2)))

    return OrientationScore(rms(total), rms(turn), rms(inclination))
