"""The gains of every algorithm, one class each, as listed in Table 10 of Nazarahari 2021.

Units: accelerometer and magnetometer relative to their norm at rest, rates in rad/s, noises σ and fractions
per sample at 100 Hz; they are converted to other rates. An adaptive gain takes a fixed value or two or three
levels (`sagittal.core.fusion.algorithms.gains`). Values: docs/science/filters.md, "Gains". Each tunable
number has its range in its type; numbers without a range are constant.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Annotated, Final

from sagittal.core.fusion.algorithms.gains import FixedGain, Gain, InnovationRules, TwoLevelGain
from sagittal.core.fusion.algorithms.tuning_ranges import (
    DEVIATION,
    DRIFT,
    LEFT,
    NOISE,
    RATE,
    SAMPLES,
    SHARE,
    TURNING,
    VARIANCE,
    WALK,
    WEIGHT,
)

MAGNETIC: Final = "magnetic"
"""Marks gains that nothing reads without a magnetometer."""


@dataclass(frozen=True)
class MadgwickGains:
    """beta : rad/s, gradient step. zeta : rad/s², of the gyroscope bias."""

    beta: Annotated[Gain, RATE] = FixedGain(0.03)
    zeta: Annotated[float, DRIFT] = 0.0


@dataclass(frozen=True)
class MadgwickImuGains:
    """Without a magnetometer; as `MadgwickGains`."""

    beta: Annotated[Gain, RATE] = FixedGain(0.03)
    zeta: Annotated[float, DRIFT] = 0.0


@dataclass(frozen=True)
class MahonyGains:
    """kp : 1/s. ki : 1/s², of the gyroscope bias."""

    kp: Annotated[Gain, RATE] = TwoLevelGain(0.1, 0.02, mag=0.1)
    ki: Annotated[float, DRIFT, MAGNETIC] = 0.0


@dataclass(frozen=True)
class HuaGains:
    """k1, k2 : 1/s, tilt and heading. k3, k4 : 1/s², bias from both. kb : 1/s, delta : rad/s, its bound."""

    k1: Annotated[float, RATE] = 0.1
    k2: Annotated[float, RATE, MAGNETIC] = 0.05
    k3: Annotated[float, DRIFT, MAGNETIC] = 0.0
    k4: Annotated[float, DRIFT, MAGNETIC] = 0.0
    kb: Annotated[float, RATE, MAGNETIC] = 1.0
    delta: Annotated[float, RATE, MAGNETIC] = 0.02


@dataclass(frozen=True)
class MartinGains:
    """la, lc, ld : 1/s, of a, a × m and (a × m) × a. sigma : 1/s, bias. n, o : scales of a and of a × m."""

    la: Annotated[float, RATE] = 0.1
    lc: Annotated[float, RATE] = 0.02
    ld: Annotated[float, RATE] = 0.002
    sigma: Annotated[float, DRIFT] = 0.0
    n: Annotated[float, RATE] = 0.1
    o: Annotated[float, RATE] = 0.1


@dataclass(frozen=True)
class FouratiGains:
    """k_a, k_m : weights of accelerometer and magnetometer. beta : 1/s."""

    k_a: Annotated[Gain, WEIGHT] = FixedGain(1.0)
    k_m: Annotated[Gain, WEIGHT, MAGNETIC] = TwoLevelGain(0.5, 0.1, mag=0.1)
    beta: Annotated[float, RATE] = 0.1


@dataclass(frozen=True)
class FouratiMartinGains(FouratiGains):
    """The same, with a × m instead of m."""


@dataclass(frozen=True)
class AquaGains:
    """Valenti 2015.

    Parameters
    ----------
    sigma_m, alpha_a : fraction of the heading and of the tilt error. e1, e2 : deviations of the accelerometer
        up to which the fraction is full, and above which it is zero. sigma_b : fraction of the bias while
        steady. s_g, s_a, s_b : steady below this rate, deviation of the accelerometer, change of the rate in
        a sample (rad/s).
    """

    sigma_m: Annotated[Gain, SHARE, MAGNETIC] = TwoLevelGain(0.001, 0.0, mag=0.1)
    sigma_b: Annotated[float, SHARE] = 0.01
    alpha_a: Annotated[float, SHARE] = 0.005
    e1: Annotated[float, DEVIATION] = 0.02
    e2: Annotated[float, DEVIATION] = 0.05
    s_g: Annotated[float, TURNING] = 0.05
    s_a: Annotated[float, DEVIATION] = 0.02
    s_b: Annotated[float, TURNING] = 0.02


@dataclass(frozen=True)
class DelRosario2016Gains:
    """mu_a, mu_m : fraction of the tilt and of the heading error; ω_L of the table is the threshold of
    mu_m.
    """

    mu_a: Annotated[Gain, SHARE] = FixedGain(0.0005)
    mu_m: Annotated[Gain, SHARE, MAGNETIC] = TwoLevelGain(0.001, 0.0003, gyr=3.0)


@dataclass(frozen=True)
class Wu2016Gains:
    """gamma_a, gamma_m : fractions. thr_a, thr_m : residual of q above which a sensor is ignored."""

    gamma_a: Annotated[Gain, SHARE] = FixedGain(0.001)
    gamma_m: Annotated[Gain, SHARE, MAGNETIC] = TwoLevelGain(0.001, 0.0, acc=0.1, mag=0.1)
    thr_a: Annotated[float, WEIGHT] = 1.0
    thr_m: Annotated[float, WEIGHT, MAGNETIC] = 1.0


@dataclass(frozen=True)
class Wu2019Gains:
    """sigma_g : scale of the correction. w_a, w_m : weights. x : fraction."""

    sigma_g: Annotated[Gain, WEIGHT] = FixedGain(1.0)
    w_a: Annotated[float, WEIGHT] = 0.75
    w_m: Annotated[float, WEIGHT, MAGNETIC] = 0.25
    x: Annotated[float, SHARE] = 0.004


@dataclass(frozen=True)
class MarantosGains:
    """w_a, w_m : weights of the two sensors. tot : of both and the prediction. S_G of the table gates w_a."""

    w_a: Annotated[Gain, SHARE] = FixedGain(0.002)
    w_m: Annotated[Gain, SHARE, MAGNETIC] = TwoLevelGain(0.002, 0.0, mag=0.1)
    tot: float = 1.0


@dataclass(frozen=True)
class JustaGains:
    """sigma_a, sigma_m : fractions of tilt and field error."""

    sigma_a: Annotated[Gain, SHARE] = FixedGain(0.002)
    sigma_m: Annotated[Gain, SHARE, MAGNETIC] = TwoLevelGain(0.002, 0.0, mag=0.1)


@dataclass(frozen=True)
class KalmanGains:
    """Common parameters of all Kalman filters.

    Parameters
    ----------
    p0 : initial variance of every state. sigma_g : rad/s. sigma_a, sigma_m : relative to the norm at rest.
    """

    p0: Annotated[float, VARIANCE] = 1e-3
    sigma_g: Annotated[Gain, NOISE] = FixedGain(0.05)
    sigma_a: Annotated[Gain, NOISE] = FixedGain(0.7)
    sigma_m: Annotated[Gain, NOISE, MAGNETIC] = TwoLevelGain(1.0, 10.0, mag=0.1)


@dataclass(frozen=True)
class MarkleyGains(KalmanGains):
    """s_b : rad/s/√s, random walk of the gyroscope bias."""

    s_b: Annotated[float, WALK, MAGNETIC] = 1.4e-4


@dataclass(frozen=True)
class GuoGains(KalmanGains):
    """adaptation : rules by which σ_G of each axis follows the innovations; sigma_g is its initial value."""

    adaptation: InnovationRules | None = None


@dataclass(frozen=True)
class GradientKalmanGains(KalmanGains):
    """mu : step of the gradient descent that forms the measurement."""

    mu: Annotated[float, WEIGHT] = 0.25


@dataclass(frozen=True)
class Wu2020PlainGains(GradientKalmanGains):
    """Wu 2020, plain."""


@dataclass(frozen=True)
class Wu2020RecursiveGains(GradientKalmanGains):
    """Wu 2020, recursive."""


@dataclass(frozen=True)
class Wu2018Gains(KalmanGains):
    """sigma_q : noise of the measured quaternion in addition to that of its sensors."""

    sigma_q: Annotated[float, NOISE] = 0.01


@dataclass(frozen=True)
class Valenti2016Gains(KalmanGains):
    """Valenti 2016."""


@dataclass(frozen=True)
class ChoukrounGains(KalmanGains):
    """Choukroun 2006."""

    sigma_a: Annotated[Gain, NOISE] = FixedGain(0.2)
    sigma_m: Annotated[Gain, NOISE, MAGNETIC] = TwoLevelGain(0.5, 5.0, mag=0.1)


@dataclass(frozen=True)
class Nazarahari2020Gains(KalmanGains):
    """Proposed linear filter.

    Parameters
    ----------
    c_a, c_d : fraction of acceleration and magnetic disturbance left after a sample. s_a, s_d : driving noise
        per √s. s_b : rad/s/√s, of a bias that is not observable (docs/science/filters.md, "Corrections to the
        texts").
    mu : step of the gradient descent.
    """

    c_a: Annotated[float, LEFT] = 0.6
    c_d: Annotated[float, LEFT] = 0.999
    s_a: Annotated[float, NOISE] = 0.064
    s_b: float = 1.4e-4
    s_d: Annotated[float, NOISE] = 0.0135
    mu: Annotated[float, WEIGHT] = 0.05


@dataclass(frozen=True)
class GyroLibGains(KalmanGains):
    """s_b : rad/s/√s, random walk of the gyroscope bias."""

    s_b: Annotated[float, WALK, MAGNETIC] = 1.4e-4


@dataclass(frozen=True)
class RenaudinGains(KalmanGains):
    """Levels of sigma_a and sigma_m are chosen by the spread of the norm over ten samples.

    Parameters
    ----------
    c_a, s_a, s_b : as in `ChenGains`; the table does not list them.
    """

    c_a: Annotated[float, LEFT] = 0.6
    s_a: Annotated[float, NOISE] = 0.064
    s_b: Annotated[float, WALK, MAGNETIC] = 1.4e-4


@dataclass(frozen=True)
class ChenGains(KalmanGains):
    """c_a : fraction of the acceleration left after a sample. s_a : its driving noise per √s. s_b : random
    walk of the bias.
    """

    c_a: Annotated[float, LEFT] = 0.6
    s_a: Annotated[float, NOISE] = 0.064
    s_b: Annotated[float, WALK, MAGNETIC] = 1.4e-4


@dataclass(frozen=True)
class SabatiniGains(KalmanGains):
    """s_b_a, s_b_m : random walk of the biases of accelerometer and magnetometer per √s."""

    p0: Annotated[float, VARIANCE] = 1e-5
    s_b_a: Annotated[float, WALK] = 1e-6
    s_b_m: Annotated[float, WALK, MAGNETIC] = 1e-4


@dataclass(frozen=True)
class Nazarahari2021Gains(KalmanGains):
    """Proposed robust filter; gamma : bound of the worst case, inf = an extended Kalman filter."""

    sigma_a: Annotated[Gain, NOISE] = FixedGain(0.72)
    sigma_m: Annotated[Gain, NOISE, MAGNETIC] = FixedGain(0.34)
    c_a: Annotated[float, LEFT] = 0.607
    c_d: Annotated[float, LEFT, MAGNETIC] = 0.99903
    s_a: Annotated[float, NOISE] = 0.064
    s_b: Annotated[float, WALK, MAGNETIC] = 1.4e-4
    s_d: Annotated[float, NOISE, MAGNETIC] = 0.0135
    gamma: float = inf


@dataclass(frozen=True)
class CubatureGains(ChenGains):
    """SRCKF: cubature points (Arasaratnam and Haykin 2009)."""


@dataclass(frozen=True)
class MerweGains(ChenGains):
    """SRUKF1: alpha, beta of van der Merwe and Wan 2001."""

    alpha: float = 1.0
    beta: float = 2.0


@dataclass(frozen=True)
class JulierGains(ChenGains):
    """SRUKF2: kappa of Julier and Uhlmann 1995, above −10."""

    kappa: float = 0.0


@dataclass(frozen=True)
class SimplexGains(ChenGains):
    """SRUKF3: weight of the first point of Julier 2003."""

    weight: float = 0.5


@dataclass(frozen=True)
class MenegazGains(ChenGains):
    """SRUKF4: weight of the first point of Menegaz 2011."""

    weight: float = 0.5


@dataclass(frozen=True)
class Suh2010Gains:
    """Suh 2010.

    Parameters
    ----------
    p0, p_b, p_b_a : initial variances: orientation, gyroscope and accelerometer bias. s_b, s_b_a : random
        walks of the biases per √s. m1 : number of averaged residuals, up to 16. gamma : excess spread that
        indicates an external acceleration. m2 : number of samples for which it is assumed to last.
    """

    p0: Annotated[float, VARIANCE] = 0.01
    p_b: Annotated[float, VARIANCE] = 1e-8
    p_b_a: Annotated[float, VARIANCE] = 1e-8
    sigma_g: Annotated[Gain, NOISE] = FixedGain(0.05)
    sigma_a: Annotated[Gain, NOISE] = FixedGain(0.7)
    sigma_m: Annotated[Gain, NOISE, MAGNETIC] = TwoLevelGain(1.0, 10.0, mag=0.1)
    s_b: Annotated[float, WALK, MAGNETIC] = 1e-7
    s_b_a: Annotated[float, WALK] = 1e-7
    m1: float = 3.0
    m2: float = 2.0
    gamma: Annotated[float, NOISE] = 0.01


@dataclass(frozen=True)
class Suh2019Gains:
    """sigma_g : rad/s. sigma_a, sigma_m : relative to the norm at rest."""

    p0: Annotated[float, VARIANCE] = 0.01
    sigma_g: Annotated[Gain, NOISE] = FixedGain(0.05)
    sigma_a: Annotated[Gain, NOISE] = FixedGain(0.7)
    sigma_m: Annotated[Gain, NOISE, MAGNETIC] = TwoLevelGain(1.0, 10.0, mag=0.1)


@dataclass(frozen=True)
class DelRosario2018Gains:
    """Del Rosario 2018.

    Parameters
    ----------
    c_a, c_m : fraction of the mean square residual added to the noise. n_s, n_l, n_m : samples of the short
        and long running mean of the accelerometer, and of the heading. xi_a : minimum noise of the
        accelerometer. xi_xy : of the heading, rad.
    """

    p0: Annotated[float, VARIANCE] = 0.01
    sigma_g: Annotated[Gain, NOISE] = FixedGain(0.05)
    c_a: Annotated[float, WEIGHT] = 1.0
    c_m: Annotated[float, WEIGHT, MAGNETIC] = 1.0
    n_s: Annotated[float, SAMPLES] = 10.0
    n_l: Annotated[float, SAMPLES] = 100.0
    n_m: Annotated[float, SAMPLES, MAGNETIC] = 100.0
    xi_a: Annotated[float, NOISE] = 0.5
    xi_xy: Annotated[float, NOISE, MAGNETIC] = 0.5


@dataclass(frozen=True)
class RoetenbergGains(KalmanGains):
    """Roetenberg 2005 in the form of a vendor's `ahrsfilter`.

    Parameters
    ----------
    zeta : rad/s/√s, random walk of the gyroscope bias. xi : variance added to the acceleration per sample.
        gamma : variance added to the magnetic disturbance per sample. sigma : fraction of it left after one.
        m_exp : strength of the field; a disturbance of more than twice this value is treated as jamming.
    """

    zeta: Annotated[float, WALK, MAGNETIC] = 1.4e-4
    xi: Annotated[float, VARIANCE] = 1e-2
    gamma: Annotated[float, VARIANCE, MAGNETIC] = 1e-3
    sigma: Annotated[float, LEFT, MAGNETIC] = 0.5
    m_exp: Annotated[float, WEIGHT, MAGNETIC] = 0.5


@dataclass(frozen=True)
class LigorioGains:
    """Ligorio 2015.

    Parameters
    ----------
    p_a, p_m : initial variances. c_a, c_m : fraction of acceleration and magnetic disturbance left after a
        sample. s_a, s_m : their driving noise per sample.
    """

    p_a: Annotated[float, VARIANCE] = 0.01
    p_m: Annotated[float, VARIANCE] = 0.01
    sigma_g: Annotated[Gain, NOISE] = FixedGain(0.02)
    sigma_a: Annotated[Gain, NOISE] = FixedGain(0.7)
    sigma_m: Annotated[Gain, NOISE] = TwoLevelGain(1.0, 10.0, mag=0.1)
    c_a: Annotated[float, LEFT] = 0.6
    s_a: Annotated[float, NOISE] = 0.1
    c_m: Annotated[float, LEFT] = 0.99
    s_m: Annotated[float, NOISE] = 0.01


@dataclass(frozen=True)
class HyytiGains:
    """Hyyti 2015.

    Parameters
    ----------
    p_dcm, p_b : initial variances. s_b : random walk of the bias. sigma_a : weight of the deviation of the
        accelerometer from the vertical. sigma_f : minimum noise.
    """

    p_dcm: Annotated[float, VARIANCE] = 0.01
    p_b: Annotated[float, VARIANCE] = 1e-4
    sigma_g: Annotated[Gain, NOISE] = FixedGain(0.05)
    sigma_a: Annotated[Gain, NOISE] = FixedGain(10.0)
    s_b: Annotated[float, WALK] = 1.4e-4
    sigma_f: Annotated[float, NOISE] = 0.5


AlgorithmGains = (
    MadgwickGains | MadgwickImuGains | MahonyGains | HuaGains | MartinGains | FouratiGains | AquaGains
    | DelRosario2016Gains | Wu2016Gains | Wu2019Gains | MarantosGains | JustaGains | KalmanGains
    | Suh2010Gains | Suh2019Gains | DelRosario2018Gains | LigorioGains | HyytiGains
)  # fmt: skip
"""The gains of some algorithm."""
