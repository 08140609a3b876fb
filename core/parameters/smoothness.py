"""Smoothness of the trunk over a stride: the spectral arc length of its acceleration.

SPARC (Balasubramanian et al. 2015, J NeuroEng Rehabil 12:112): minus the length of the curve of the
normalised amplitude spectrum up to the last frequency, 10 Hz at most, at which it exceeds 5 %; for an
accelerometer the signal is | ‖f‖ − g | (its table 3). More sub-movements cause more peaks and a longer curve:
closer to 0 is smoother. There is no norm for it here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from sagittal.core.frames import GRAVITY, Floats, Segment
from sagittal.core.parameters.resample import resample
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.variability import summarise_values
from sagittal.core.signals.rest import Window

NAME: Final = "stride_sparc"

THRESHOLD: Final = 0.05
"""Share of the amplitude at 0 Hz below which the end of the spectrum does not count (same paper)."""

LIMIT_HZ: Final = 10.0
"""Highest frequency of a movement (same paper)."""

POINTS: Final = 128
"""Points of a stride: above 10 Hz up to strides of 6 s."""

PADDING: Final = 16
"""Times the length, for a smooth spectrum (2⁴, as the authors' programme)."""

AT_ONCE: Final = 256
"""Strides whose padded spectra are held together: 16 kB each, and their curves."""


def stride_smoothness(strides: Sequence[Window], t_s: Floats, trunk: Mapping[Segment, Floats]) -> Parameter:
    """`stride_sparc` of the pelvis over these strides.

    Parameters
    ----------
    strides : first and last contact of each, s. trunk : pelvis → (n, 3) gravity-free acceleration, forward,
        left, up, on the uniform axis `t_s` (n,).

    Returns
    -------
    Parameter; without a value a reason: "no_pelvis_sensor", "no_strides", "no_forward", "gap".
    """
    if "pelvis" not in trunk:
        return summarise_values(NAME, None, [], "", "no_pelvis_sensor")
    if not strides:
        return summarise_values(NAME, None, [], "", "no_strides")
    forward, left, up = trunk["pelvis"].T
    force = np.sqrt(forward**2 + left**2 + (up + GRAVITY) ** 2)
    bounds = np.array(strides)
    pieces = resample(np.abs(force - GRAVITY)[None], t_s, bounds, POINTS + 1)[0][:, :-1]
    values = spectral_arc_length(pieces, (bounds[:, 1] - bounds[:, 0]) / POINTS)
    finite_values = values[np.isfinite(values)]
    return summarise_values(
        NAME, None, finite_values, "", "gap" if np.isfinite(force).any() else "no_forward"
    )


def spectral_arc_length(pieces: Floats, step_s: Floats) -> Floats:
    """SPARC (m,) of non-negative signals (m, points) with samples `step_s` (m,) apart.

    NaN if the signal is 0 throughout, not finite or sampled too coarsely for a spectrum.
    """
    n = PADDING * pieces.shape[1]
    n_bins = int(np.ceil(LIMIT_HZ * n * float(np.max(step_s, initial=0.0)))) + 2
    arc_lengths = np.empty(len(pieces))
    for first in range(0, len(pieces), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        arc_lengths[part] = _measure_arcs(pieces[part], step_s[part], n, n_bins)
    return arc_lengths


def _measure_arcs(pieces: Floats, step_s: Floats, n: int, n_bins: int) -> Floats:
    """SPARC of signals padded to n points, using this many frequencies."""
    spectrum = np.abs(np.fft.rfft(pieces, n, axis=1)[:, :n_bins])
    dc = spectrum[:, :1]
    shape = spectrum / np.where(dc > 0.0, dc, np.nan)
    frequency = np.arange(shape.shape[1]) / (n * step_s[:, None])
    counts = (shape > THRESHOLD) & (frequency <= LIMIT_HZ)
    last = shape.shape[1] - 1 - np.argmax(counts[:, ::-1], axis=1)
    # frequency runs from 0 to 1 over what counts
    along = 1.0 / np.maximum(last, 1)[:, None]
    steps = np.hypot(along, np.diff(shape, axis=1))
    inside = np.arange(steps.shape[1]) < last[:, None]
    length = np.where(inside, steps, 0.0).sum(axis=1)
    return np.asarray(np.where(counts.any(axis=1) & (last > 0) & np.isfinite(dc[:, 0]), -length, np.nan))
