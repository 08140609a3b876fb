"""Step time of a walking trunk from the periodicity of its movement.

The vertical movement of the trunk repeats with every step; its angular velocity repeats with every stride,
with roll and yaw reversed half a stride later. The lag T at which all of this holds at once is the step time:

    score(T) = ¼ (r_a(T) + r_a(2T) + r_ω(2T) − r_ω(T))

with r the normalised autocorrelation of vertical acceleration (a) and of angular velocity as a vector (ω),
which is independent of the orientation of the sensor. Without a gyroscope the horizontal acceleration (h)
takes its place, which repeats with every stride whatever its lateral component:

    score(T) = ⅓ (r_a(T) + r_a(2T) + r_h(2T))

Step and stride regularity of the vertical acceleration alone (Moe-Nilssen & Helbostad 2004, J Biomech 37:121)
cannot exclude half or double the step time: slow walking has two peaks per step. The combination of the four
terms is our choice; on the simulated people (tests) it gives the step time where the acceleration alone
fails.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from sagittal.core.frames import Floats
from sagittal.core.signals.filtering import smooth_gaussian

TOGETHER: Final = 64
"""Windows whose rhythm is looked for at a time."""


@dataclass(frozen=True)
class PeriodicityParams:
    """Search for the step time.

    Parameters
    ----------
    window_s, hop_s : length and spacing of the windows: three strides of a slow walk, one step.
    shortest_s, longest_s : range of lags; the shortest are no steps, but are included so that a rhythm too
        fast to be resolved is not mistaken for one half as fast.
    least : minimum score to accept the step time of a window. row, row_score, row_spread : number of
        consecutive windows, their mean score, and maximum deviation of step times from their median required
        for walking. Our choice: coloured noise of any bandwidth exceeds 0.4 in 5 % of the windows and a mean
        of 0.45 in 1 % of the rows; people in mobgap_lowback and neura_walk reach rows of 0.6 to 0.7, the
        simulated ones 0.5 (hemiparesis) to 0.97.
    nearly : the shortest lag that reaches this fraction of the best score is used: odd multiples have equal
        scores.
    smooth_s, slow_s : σ of the Gaussians that remove noise, and turns and leaning, beforehand.
    """

    window_s: float = 4.0
    hop_s: float = 1.0
    shortest_s: float = 0.12
    longest_s: float = 1.4
    least: float = 0.4
    row: int = 3
    row_score: float = 0.45
    row_spread: float = 0.15
    nearly: float = 0.85
    smooth_s: float = 0.03
    slow_s: float = 0.6


@dataclass(frozen=True, eq=False)
class Periodicity:
    """Step time along a recording.

    Parameters
    ----------
    t_s : (w,) centres of the windows. step_s : (w,) best lag, NaN without any. score : (w,) −1 to 1.
    """

    t_s: Floats
    step_s: Floats
    score: Floats

    def walks(self, step_s: tuple[float, float], params: PeriodicityParams) -> bool:
        """Whether any row of windows is periodic like walking, with a step time in the range."""
        for i in range(len(self.score) - min(params.row, len(self.score)) + 1):
            steps, score = self.step_s[i : i + params.row], self.score[i : i + params.row]
            middle = float(np.median(steps))
            close = np.all(np.abs(steps - middle) <= params.row_spread * middle)
            if close and step_s[0] <= middle <= step_s[1] and score.mean() >= params.row_score:
                return True
        return False


def step_times(
    vertical: Floats,
    gyr: Floats | None,
    rate_hz: float,
    params: PeriodicityParams | None = None,
    horizontal: Floats | None = None,
) -> Periodicity:
    """Step time in windows along a recording.

    Parameters
    ----------
    vertical : (n,) m/s². gyr : (n, 3) rad/s, in any orientation; None without a gyroscope, which requires
        horizontal : (n, 3) horizontal acceleration, m/s².
    """
    params = params or PeriodicityParams()
    second = horizontal if gyr is None else gyr
    assert second is not None  # noqa: S101 - the caller gives one of them
    width = min(len(vertical), round(params.window_s * rate_hz))
    hop = max(1, round(params.hop_s * rate_hz))
    a, w = (
        sliding_window_view(_between(x, rate_hz, params), width, axis=1)[:, ::hop]
        for x in (vertical[None], second.T)
    )
    lag = _list_lags(width, rate_hz, params)
    step_s, score = np.full(a.shape[1], np.nan), np.zeros(a.shape[1])
    for first in range(0, len(score) if len(lag) > 2 else 0, TOGETHER):
        part = slice(first, first + TOGETHER)
        scores = _score_lags(a[:, part], w[:, part], lag, turns=gyr is not None)
        best = _choose(scores, params.nearly)
        is_periodic = best >= 0
        step_s[part][is_periodic] = lag[best[is_periodic]] / rate_hz
        score[part][is_periodic] = scores[is_periodic, best[is_periodic]]
    middles = (hop * np.arange(len(score)) + 0.5 * width) / rate_hz
    return Periodicity(np.asarray(middles), step_s, score)


def _list_lags(width: int, rate_hz: float, params: PeriodicityParams) -> NDArray[np.int64]:
    """Candidate step times for windows of this length, in samples."""
    first = max(2, round(params.shortest_s * rate_hz))
    last = min(round(params.longest_s * rate_hz), round(0.375 * width))
    return np.arange(first, last + 1)


def _score_lags(a: Floats, w: Floats, lag: NDArray[np.int64], *, turns: bool) -> Floats:
    """Scores (k, lags) of windows a (1, k, width) and w (c, k, width). turns : w is an angular velocity."""
    r_a, r_w = (_autocorrelation(x, 2 * int(lag[-1]) + 1) for x in (a, w))
    if turns:
        score = 0.25 * (r_a[:, lag] + r_a[:, 2 * lag] + r_w[:, 2 * lag] - r_w[:, lag])
    else:
        score = (r_a[:, lag] + r_a[:, 2 * lag] + r_w[:, 2 * lag]) / 3.0
    return np.asarray(score)


def _choose(score: Floats, nearly: float) -> NDArray[np.int64]:
    """Index (k,) of the shortest lag among the maxima of each score (k, lags) that is nearly the best.

    −1 if no maximum is above 0.
    """
    top = (score[:, 1:-1] >= score[:, :-2]) & (score[:, 1:-1] > score[:, 2:])
    height = np.where(top, score[:, 1:-1], -np.inf)
    best = height.max(axis=1)
    shortest = np.argmax(height >= nearly * best[:, None], axis=1) + 1
    return np.where(best > 0.0, shortest, -1)


def _between(x: Floats, rate_hz: float, params: PeriodicityParams) -> Floats:
    """Signals x (c, n) band-passed to the range of steps."""
    quick, slow = params.smooth_s * rate_hz, params.slow_s * rate_hz
    return np.array([smooth_gaussian(row, quick) - smooth_gaussian(row, slow) for row in x])


def _autocorrelation(x: Floats, lags: int) -> Floats:
    """Correlation (k, lags) of windows with themselves shifted, normalised by the energy of the two parts.

    Parameters
    ----------
    x : (c, k, n) components of a vector; the mean of each over the window is subtracted.
    """
    n = x.shape[-1]
    x = x - x.mean(axis=-1, keepdims=True)
    size = 2 ** int(np.ceil(np.log2(n + lags)))
    spectrum = np.fft.rfft(x, size)
    product = np.fft.irfft((spectrum.real**2 + spectrum.imag**2).sum(axis=0), size)[:, :lags]
    energy = np.zeros((x.shape[1], n + 1))
    np.cumsum((x**2).sum(axis=0), axis=-1, out=energy[:, 1:])
    norm = np.sqrt(energy[:, n : n - lags : -1] * (energy[:, -1:] - energy[:, :lags]))
    return np.asarray(np.divide(product, norm, out=np.zeros(norm.shape), where=norm > 1e-12))
