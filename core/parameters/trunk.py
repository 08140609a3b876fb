"""Regularity of trunk movement: harmonic ratio and autocorrelation of its acceleration in straight walking.

Harmonic ratio of a stride: the acceleration over one stride as a Fourier series of the stride's frequency;
the sum of the amplitudes of the first ten even harmonics over that of the first ten odd ones, for left-right
the reverse (Gage 1964; Smidt, Arora and Johnston 1971; Bellanca et al. 2013). Two equal steps contribute only
to the even ones; the ratio measures the similarity of the two steps of a stride. There is no norm for it
here.

Regularity: the unbiased autocorrelation at the time of one step and of one stride, where its peak is
(Moe-Nilssen and Helbostad 2004); 1 = every step, or stride, equals the previous one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from sagittal.core.events.result import Strides
from sagittal.core.frames import SIDES, Floats, Segment
from sagittal.core.parameters.resample import resample
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.variability import STEADY_STRIDES, summarise_values
from sagittal.core.signals.rest import Window

AXES: Final[Mapping[str, int]] = {"v": 2, "ap": 0, "ml": 1}
"""Ending of the name → column of the acceleration: vertical, forward, sideways."""

REGULAR_AXES: Final = ("v", "ap")
"""Sideways a step is the mirror image of the one before and has no regularity of steps."""

HARMONICS: Final = 20
"""Harmonics of the stride's frequency in the ratio: ten even, ten odd."""

POINTS: Final = 200
"""Points of a stride for its series: ten for the shortest period."""

SEARCH: Final = 0.15
"""How far from half a stride and from a stride, in strides, the peak is looked for: unequal steps move it.
Our choice: not so far that a step could be taken for a stride."""

RUN_STRIDES: Final = 3
"""Fewest strides in a row that tell how alike strides are. Our choice: two overlaps of a stride."""

NAMES: Final = (
    *(f"harmonic_ratio_{axis}" for axis in AXES),
    *(f"step_regularity_{axis}" for axis in REGULAR_AXES),
    *(f"stride_regularity_{axis}" for axis in REGULAR_AXES),
)
"""In the order of the tables."""


def choose_foot(strides: Strides) -> tuple[Window, ...]:
    """Counted strides of the foot with more of them: strides of both feet overlap, those of one foot cover
    everything once.
    """
    own = max((strides.columns.used[side] for side in SIDES), key=len)
    return tuple(zip(strides.columns.start_s[own].tolist(), strides.columns.end_s[own].tolist(), strict=True))


def trunk_regularity(
    strides: Sequence[Window], t_s: Floats, trunk: Mapping[Segment, Floats]
) -> tuple[Parameter, ...]:
    """Harmonic ratios and regularity over strides of one foot.

    Parameters
    ----------
    strides : first and last contact of each, s, in order.
    trunk : pelvis → (n, 3) gravity-free acceleration, forward, left, up, on the uniform axis `t_s` (n,); NaN
        where lost, a column of NaN for an unknown axis.

    Returns
    -------
    The ratio with its spread over strides, the regularity over all walking; without a value a reason:
    "no_pelvis_sensor", "no_strides", "no_forward" (an unknown axis), "gap", "no_run" (no three consecutive
    strides).
    """
    if "pelvis" not in trunk:
        return tuple(summarise_values(name, None, [], "", "no_pelvis_sensor") for name in NAMES)
    if not strides:
        return tuple(summarise_values(name, None, [], "", "no_strides") for name in NAMES)
    acceleration = trunk["pelvis"]
    return (*_harmonic_ratios(strides, t_s, acceleration), *_regularity(strides, t_s, acceleration))


def harmonic_ratios(pieces: Floats) -> dict[str, Floats]:
    """Ratios (strides,) by axis of accelerations (3, strides, points) over whole strides, end point
    excluded.
    """
    amplitude = np.abs(np.fft.rfft(pieces, axis=-1)[..., 1 : HARMONICS + 1])
    odd, even = amplitude[..., ::2].sum(axis=-1), amplitude[..., 1::2].sum(axis=-1)
    ratios = {}
    for axis, column in AXES.items():
        numerator, denominator = (odd[column], even[column]) if axis == "ml" else (even[column], odd[column])
        ratios[axis] = numerator / np.where(denominator > 0.0, denominator, np.nan)
    return ratios


def _why(acceleration: Floats, axis: str) -> str:
    """Why an axis has no values: lost, or unknown."""
    return "gap" if np.isfinite(acceleration[:, AXES[axis]]).any() else "no_forward"


def _harmonic_ratios(own: Sequence[Window], t_s: Floats, acceleration: Floats) -> Iterator[Parameter]:
    pieces = np.stack(resample(acceleration.T, t_s, np.array(own), POINTS + 1))[..., :-1]
    for axis, values in harmonic_ratios(pieces).items():
        finite_values = values[np.isfinite(values)]
        yield summarise_values(f"harmonic_ratio_{axis}", None, finite_values, "", _why(acceleration, axis))


def _regularity(own: Sequence[Window], t_s: Floats, acceleration: Floats) -> Iterator[Parameter]:
    runs = [run for run in _runs(own) if len(run) >= RUN_STRIDES]
    pieces = [acceleration[slice(*np.searchsorted(t_s, (r[0][0], r[-1][1])))] for r in runs]
    stride = float(np.median(np.diff(np.array(own)))) * (len(t_s) - 1) / float(t_s[-1] - t_s[0])
    for name, share in (("step", 0.5), ("stride", 1.0)):
        lags = np.arange(round((share - SEARCH) * stride), round((share + SEARCH) * stride) + 1)
        for axis in REGULAR_AXES:
            label, along = f"{name}_regularity_{axis}", [a[:, AXES[axis]] for a in pieces]
            whole = [(len(r), a) for r, a in zip(runs, along, strict=True) if np.isfinite(a).all()]
            n = sum(strides for strides, _ in whole)
            if not whole:
                yield summarise_values(label, None, [], "", _why(acceleration, axis) if runs else "no_run")
                continue
            alike = _autocorrelation([a for _, a in whole], lags)
            note = "few_strides" if n < STEADY_STRIDES else None
            yield Parameter(label, None, n, float(alike.max()), None, "", note=note)


def _autocorrelation(pieces: Sequence[Floats], lags: np.ndarray) -> Floats:
    """Unbiased autocorrelation (lags,) of pieces of one signal, relative to their common mean."""
    mean = np.concatenate(pieces).mean()
    centred = [a - mean for a in pieces]
    # a signal that never changes is not alike anything
    power = sum(float(a @ a) for a in centred) / sum(len(a) for a in centred) or np.inf
    products, counts = np.zeros(len(lags)), np.zeros(len(lags))
    for a in centred:
        for i, lag in enumerate(lags[lags < len(a)].tolist()):
            products[i] += float(a[lag:] @ a[: len(a) - lag])
            counts[i] += len(a) - lag
    return np.asarray(products / np.maximum(counts, 1.0) / power)


def _runs(own: Sequence[Window]) -> Iterator[list[Window]]:
    """Consecutive strides of one foot without a break."""
    run: list[Window] = []
    for s in own:
        if run and s[0] != run[-1][1]:
            yield run
            run = []
        run.append(s)
    if run:
        yield run
