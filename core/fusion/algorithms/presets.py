"""Gains for sensors on a walking body, at 100 Hz: those of Nazarahari 2021, and those tuned here.

Separate for each segment: the gains of one segment perform poorly on another.
"""

from __future__ import annotations

from typing import Final, Literal

from sagittal.core.fusion.algorithms.gains import FixedGain, ThreeLevelGain, TwoLevelGain
from sagittal.core.fusion.algorithms.parameters import (
    AlgorithmGains,
    AquaGains,
    MadgwickGains,
    MadgwickImuGains,
    MahonyGains,
    Nazarahari2021Gains,
)
from sagittal.core.fusion.algorithms.schemes import Scheme

LegSegment = Literal["thigh", "shank", "foot"]
BodyPlace = Literal["foot", "shank", "thigh", "pelvis"]

MADGWICK_ON_A_LEG: Final[dict[tuple[Scheme, LegSegment], MadgwickGains]] = {
    ("fixed", "thigh"): MadgwickGains(FixedGain(0.073), 6e-4),
    ("fixed", "shank"): MadgwickGains(FixedGain(0.004), 6e-6),
    ("fixed", "foot"): MadgwickGains(FixedGain(0.003), 1e-12),
    ("two_levels", "thigh"): MadgwickGains(TwoLevelGain(0.082, 1e-5, acc=0.122, mag=0.051), 1e-12),
    ("two_levels", "shank"): MadgwickGains(TwoLevelGain(0.050, 1e-5, acc=0.064, mag=0.085), 9e-5),
    ("two_levels", "foot"): MadgwickGains(TwoLevelGain(0.045, 1e-12, acc=0.019, mag=0.404), 1e-25),
    ("three_levels", "thigh"): MadgwickGains(
        ThreeLevelGain(0.089, 0.005, 1e-18, acc=(0.135, 0.200), mag=(0.052, 0.201)), 2e-14
    ),
    ("three_levels", "shank"): MadgwickGains(
        ThreeLevelGain(0.082, 1e-3, 1e-18, acc=(0.067, 0.150), mag=(0.086, 0.128)), 1e-4
    ),
    ("three_levels", "foot"): MadgwickGains(
        ThreeLevelGain(0.050, 0.006, 1e-18, acc=(0.100, 0.204), mag=(0.200, 0.207)), 1e-25
    ),
}
"""Scheme and segment → gains of Table 6, fitted there to sensors on the legs of three people."""

TUNED_ON_WALKERS: Final[dict[tuple[str, BodyPlace], AlgorithmGains]] = {
    ("madgwick_2011_imu", "foot"): MadgwickImuGains(beta=FixedGain(0.009029), zeta=0.001533),
    ("madgwick_2011_imu", "shank"): MadgwickImuGains(beta=FixedGain(0.01585), zeta=2.439e-11),
    ("madgwick_2011_imu", "thigh"): MadgwickImuGains(beta=FixedGain(0.003114), zeta=1.216e-10),
    ("madgwick_2011_imu", "pelvis"): MadgwickImuGains(beta=FixedGain(0.00793), zeta=0.0004991),
    ("mahony_2008", "thigh"): MahonyGains(kp=FixedGain(0.1134)),
    ("mahony_2008", "pelvis"): MahonyGains(kp=FixedGain(0.2152)),
    ("valenti_2015", "shank"): AquaGains(
        sigma_b=0.0403, alpha_a=0.0001784, e1=0.002805, e2=0.01418, s_g=0.008521, s_a=0.00766, s_b=3.913
    ),
    ("valenti_2015", "thigh"): AquaGains(
        sigma_b=0.01716, alpha_a=0.0006316, e1=0.003283, e2=0.01627, s_g=0.0157, s_a=0.114, s_b=13.07
    ),
    ("valenti_2015", "pelvis"): AquaGains(
        sigma_b=0.03979, alpha_a=0.002528, e1=0.003126, e2=0.01327, s_g=0.01301, s_a=0.02779, s_b=0.7868
    ),
    ("nazarahari_2021", "foot"): Nazarahari2021Gains(
        p0=3.628e-08, sigma_g=FixedGain(0.04935), sigma_a=FixedGain(0.4498), c_a=0.6402, s_a=0.1782
    ),
    ("nazarahari_2021", "shank"): Nazarahari2021Gains(
        p0=3.227e-07, sigma_g=FixedGain(0.1062), sigma_a=FixedGain(0.9138), c_a=0.4217, s_a=0.07835
    ),
    ("nazarahari_2021", "thigh"): Nazarahari2021Gains(
        p0=3.062e-08, sigma_g=FixedGain(0.1132), sigma_a=FixedGain(0.9809), c_a=0.3945, s_a=0.07302
    ),
    ("nazarahari_2021", "pelvis"): Nazarahari2021Gains(
        p0=1.187e-05, sigma_g=FixedGain(0.05458), sigma_a=FixedGain(0.1449), c_a=0.98304, s_a=0.04105
    ),
}
"""Algorithm and place → gains without a magnetometer, where they did better than the defaults.

Fitted by `sagittal tune` to eight simulated people and shown on six others, healthy and not
(`validation/accuracy/tuned_walks.py`), and on sensors of two real people beside optical segments. There
`nazarahari_2021` is clearly better on the foot, and no other set differs from the defaults by more than 0.3°:
docs/science/filters.md, "Sets for foot, shank, thigh and pelvis".
"""
