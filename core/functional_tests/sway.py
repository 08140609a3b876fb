"""Sway in quiet standing from the trunk's horizontal acceleration (docs/science/sway.md)."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians
from typing import Final

import numpy as np

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.functional_tests.result import FunctionalTest, TimedSegment, state_figures
from sagittal.core.functional_tests.trunk import find_trunk_sensor
from sagittal.core.parameters.catalogue import list_names
from sagittal.core.parameters.catalogue.entry import SWAY
from sagittal.core.signals.filtering import low_pass
from sagittal.core.signals.recording import GivenLimits, UniformRecording
from sagittal.core.signals.rest import QuietParams, Window, find_rest_windows, index_window

NAMES: Final = list_names(SWAY, "take")

STANDING_QUIETLY: Final = QuietParams(
    window_s=1.0, gyro_limit=radians(20.0), acc_std_limit=0.5, shortest_s=2.0
)
"""Standing that sways is no rest of the gyroscope; a step ends it (our choice)."""

F_95: Final = 3.0
"""95 % quantile of F with 2 and many degrees of freedom."""


@dataclass(frozen=True)
class SwayParams:
    """Parameters of quiet standing.

    Parameters
    ----------
    shortest_s : minimum duration of standing. longest_s : maximum duration, taken from its middle (our
        choices).
    cutoff_hz : of the acceleration (Mancini et al. 2012). drift_hz : lower limit of integration.
        noise_share : maximum fraction of sensor noise in the power of a parameter.
    """

    shortest_s: float = 20.0
    longest_s: float = 60.0
    cutoff_hz: float = 3.5
    drift_hz: float = 0.1
    noise_share: float = 0.25


def measure_sway(
    recording: UniformRecording, limits: GivenLimits | None = None, params: SwayParams | None = None
) -> FunctionalTest:
    """Detect the longest quiet standing and measure its sway.

    Returns
    -------
    FunctionalTest; parameters have no value and the reason "standing_too_short" without sufficiently long
    quiet standing, "noise_dominated" if the fraction of sensor noise is too large.

    Raises
    ------
    EstimationError `segments_missing` without a sensor on pelvis or chest.
    """
    params, limits = params or SwayParams(), limits or GivenLimits()
    segment = find_trunk_sensor(recording)
    window = _choose(recording, segment, limits, params)
    corrected = limits.start_s is not None or limits.end_s is not None
    if window is None:
        rows = state_figures({}, NAMES, "standing_too_short")
        return FunctionalTest(limits.start_s, limits.end_s, (), rows, segment, corrected)
    part = index_window(window, recording.rate_hz)
    plane = project_horizontally(recording.sensors[segment].acc[part])
    values, noise = measure_figures(plane, recording.rate_hz, params)
    figures: dict[str, float | None] = {
        name: value if noise[name] <= params.noise_share else None for name, value in values.items()
    }
    figures["sway_duration_s"] = window[1] - window[0]
    rows = state_figures(figures, NAMES, "noise_dominated")
    standing = (TimedSegment("standing", *window),)
    return FunctionalTest(window[0], window[1], standing, rows, segment, corrected)


def project_horizontally(acc: Floats) -> Floats:
    """Two horizontal components (n, 2) in m/s² of a specific force (n, 3), with their mean subtracted.

    The vertical is the mean direction of the force; the heading is undetermined.
    """
    mean = acc.mean(axis=0)
    norm = float(np.linalg.norm(mean))
    _, _, axes = np.linalg.svd(mean[None])
    plane = acc @ axes[1:].T * (GRAVITY / norm)
    return np.asarray(plane - plane.mean(axis=0))


def measure_figures(
    plane: Floats, rate_hz: float, params: SwayParams
) -> tuple[dict[str, float], dict[str, float]]:
    """Sway parameters of a horizontal acceleration (n, 2), and the fraction of sensor noise in each."""
    acc = low_pass(plane.T, params.cutoff_hz, rate_hz).T
    acc = acc - acc.mean(axis=0)
    n = len(acc)
    radius = np.linalg.norm(acc, axis=1)
    change = np.diff(acc, axis=0)
    path = float(np.linalg.norm(change, axis=1).sum())
    covariance = np.cov(acc.T)
    speed = low_pass(np.cumsum(acc, axis=0).T / rate_hz, params.cutoff_hz, rate_hz)
    speed = speed - low_pass(speed, params.drift_hz, rate_hz)
    frequencies, power = _spectrum(acc, rate_hz)
    band = (frequencies >= params.drift_hz) & (frequencies <= params.cutoff_hz)
    power_in = power[band]
    squares = float((power_in * frequencies[band] ** 2).sum())
    values = {
        "sway_rms_mps2": float(np.sqrt((acc**2).sum(axis=1).mean())),
        "sway_area_m2ps4": 2.0 * pi * F_95 * float(np.sqrt(max(np.linalg.det(covariance), 0.0))),
        "sway_path_mps2": path,
        "sway_velocity_mps": float(np.linalg.norm(speed, axis=0).mean()),
        "sway_mean_frequency_hz": path / (2.0 * pi * float(radius.mean()) * n / rate_hz),
        "sway_centroid_frequency_hz": float(np.sqrt(squares / power_in.sum())),
        "sway_jerk_m2ps5": 0.5 * float((change**2).sum()) * rate_hz,
    }
    white = _noise_density(plane, rate_hz)
    still = white * params.cutoff_hz / max(float((acc**2).sum(axis=1).mean()), 1e-12)
    # the power of a rate grows with the square of the frequency
    moving = white * (2.0 * pi) ** 2 * params.cutoff_hz**3 / 3.0
    moving /= max(float((change**2).sum(axis=1).mean()) * rate_hz**2, 1e-12)
    quick = {"sway_path_mps2", "sway_mean_frequency_hz", "sway_jerk_m2ps5", "sway_centroid_frequency_hz"}
    return values, {name: moving if name in quick else still for name in values}


def _choose(
    recording: UniformRecording, segment: str, limits: GivenLimits, params: SwayParams
) -> Window | None:
    """The longest quiet standing within the manually given limits; None if too short."""
    low = 0.0 if limits.start_s is None else limits.start_s
    high = float(recording.t_s[-1]) if limits.end_s is None else limits.end_s
    windows = find_rest_windows(recording, STANDING_QUIETLY, (segment,))  # type: ignore[arg-type]
    parts = [(max(a, low), min(b, high)) for a, b in windows]
    best = max(parts, key=lambda w: w[1] - w[0], default=(0.0, 0.0))
    length = best[1] - best[0]
    if length < params.shortest_s:
        return None
    spare = 0.5 * max(0.0, length - params.longest_s)
    return best[0] + spare, best[1] - spare


def _spectrum(acc: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Frequencies and total power density of both components, (m/s²)²/Hz."""
    from scipy.signal import periodogram

    frequencies, power = periodogram(acc, rate_hz, window="hann", axis=0)
    return frequencies, np.asarray(power.sum(axis=1))


def _noise_density(plane: Floats, rate_hz: float) -> float:
    """Noise power density in (m/s²)²/Hz of both components above body sway; 0 below 25 Hz, where it cannot
    be determined.
    """
    if rate_hz < 25.0:
        return 0.0
    frequencies, power = _spectrum(plane, rate_hz)
    high = (frequencies >= 0.3 * rate_hz) & (frequencies <= 0.45 * rate_hz)
    # the median of a spectrum of white noise is ln 2 of its mean for one component; for two it is 0.84
    return float(np.median(power[high])) / 0.84
