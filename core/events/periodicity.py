"""The step time of a walking trunk, from how its movement repeats.

What the trunk does vertically repeats with every step; its angular velocity repeats with every stride, and
half a stride later roll and yaw are reversed. The lag T at which all of this holds at once is the step time:

    score(T) = ¼ (r_a(T) + r_a(2T) + r_ω(2T) − r_ω(T))

with r the normalised autocorrelation of vertical acceleration (a) and of angular velocity as a vector (ω),
which no mounting of the sensor changes. Without a gyroscope the horizontal acceleration (h) takes its place,
which repeats with every stride whatever its share from side to side:

    score(T) = ⅓ (r_a(T) + r_a(2T) + r_h(2T))

Step and stride regularity of the vertical acceleration alone
(Moe-Nilssen & Helbostad 2004, J Biomech 37:121) tell neither half nor double the step time apart: a slow walk
has two peaks a step. The four terms together are our choice; on the simulated people (tests) they give the
step time where the acceleration alone fails.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.frames import Floats


@dataclass(frozen=True)
class PeriodicityParams:
    """How the step time is looked for.

    Parameters
    ----------
    window_s, hop_s : length and distance of the windows: three strides of a slow walk, one step further.
    shortest_s, longest_s : lags that are tried; the shortest are no steps, but must be tried so that a
        rhythm too quick to be followed is not taken for one half as quick.
    least : score from which the step time of a window is believed. row, row_score, row_spread : so many
        successive windows must reach this mean score with step times this close to their median before a take
        is called walking at all. Our choice: coloured noise of any bandwidth exceeds 0.4 in 5 % of the
        windows and a mean of 0.45 in 1 % of the rows; people of mobgap_lowback and neura_walk reach rows of
        0.6 to 0.7, the simulated ones 0.5 (hemiparesis) to 0.97.
    nearly : the shortest lag that reaches this share of the best is taken: its odd multiples score the same.
    smooth_s, slow_s : σ of the Gaussians that take off noise, and turns and leaning, first.
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
    """Step time along a take.

    Parameters
    ----------
    t_s : (w,) middles of the windows. step_s : (w,) best lag, NaN without any. score : (w,) −1 to 1.
    """

    t_s: Floats
    step_s: Floats
    score: Floats

    def walks(self, step_s: tuple[float, float], params: PeriodicityParams) -> bool:
        """Does any row of windows repeat like walking, with a step time in the range?"""
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
    """Step time in windows along a take.

    Parameters
    ----------
    vertical : (n,) m/s². gyr : (n, 3) rad/s, any mounting; None without a gyroscope, then
    horizontal : (n, 3) the rest of the acceleration, m/s².
    """
    params = params or PeriodicityParams()
    second = horizontal if gyr is None else gyr
    assert second is not None  # noqa: S101 - the caller gives one of them
    a, w = (_between(x, rate_hz, params) for x in (vertical[:, None], second))
    width = min(len(a), round(params.window_s * rate_hz))
    starts = range(0, max(1, len(a) - width + 1), max(1, round(params.hop_s * rate_hz)))
    turns = gyr is not None
    found = [_step_time(a[i : i + width], w[i : i + width], turns, rate_hz, params) for i in starts]
    return Periodicity(
        t_s=np.array([(i + 0.5 * width) / rate_hz for i in starts]),
        step_s=np.array([f[0] for f in found]),
        score=np.array([f[1] for f in found]),
    )


def _step_time(
    a: Floats, w: Floats, turns: bool, rate_hz: float, params: PeriodicityParams
) -> tuple[float, float]:
    """Step time in s and score of one window; (NaN, 0) without any. turns : w is an angular velocity."""
    first = max(2, round(params.shortest_s * rate_hz))
    last = min(round(params.longest_s * rate_hz), round(0.375 * len(a)))
    if last - first < 2:
        return float("nan"), 0.0
    r_a = _autocorrelation(a, 2 * last + 1)
    r_w = _autocorrelation(w, 2 * last + 1)
    lag = np.arange(first, last + 1)
    if turns:
        score = 0.25 * (r_a[lag] + r_a[2 * lag] + r_w[2 * lag] - r_w[lag])
    else:
        score = (r_a[lag] + r_a[2 * lag] + r_w[2 * lag]) / 3.0
    peaks = np.flatnonzero((score[1:-1] >= score[:-2]) & (score[1:-1] > score[2:])) + 1
    if not len(peaks) or score[peaks].max() <= 0.0:
        return float("nan"), 0.0
    best = peaks[np.flatnonzero(score[peaks] >= params.nearly * score[peaks].max())[0]]
    return float(lag[best] / rate_hz), float(score[best])


def _between(x: Floats, rate_hz: float, params: PeriodicityParams) -> Floats:
    """x (n, c) without what is quicker or slower than steps."""
    from scipy.ndimage import gaussian_filter1d

    quick, slow = params.smooth_s * rate_hz, params.slow_s * rate_hz
    return np.asarray(
        gaussian_filter1d(x, quick, axis=0, mode="nearest")
        - gaussian_filter1d(x, slow, axis=0, mode="nearest")
    )


def _autocorrelation(x: Floats, lags: int) -> Floats:
    """Correlation (lags,) of x (n, c) with itself later, each lag by the energy of its two parts."""
    x = x - x.mean(axis=0)
    n = len(x)
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    spectrum = np.fft.rfft(x, size, axis=0)
    product = np.fft.irfft((np.abs(spectrum) ** 2).sum(axis=1), size)[:lags]
    energy = np.concatenate(([0.0], np.cumsum((x**2).sum(axis=1))))
    k = np.arange(lags)
    norm = np.sqrt(energy[n - k] * (energy[n] - energy[k]))
    return np.asarray(np.divide(product, norm, out=np.zeros(lags), where=norm > 1e-12))
