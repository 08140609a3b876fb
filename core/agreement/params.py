"""Parameters of the agreement of sensors: what is compared, and from where on something is told."""

from __future__ import annotations

from dataclasses import dataclass, field

from core.fusion.attitude import AttitudeParams


@dataclass(frozen=True)
class JointParams:
    """How the two sources of a joint's acceleration are compared (docs/science/agreement.md, "One idea").

    Parameters
    ----------
    band_hz : of the acceleration. Below 0.5 Hz lies the error of the tilt, above 6 Hz the flesh: with bands
        up to 12 Hz clean knees seem 5 to 13 ms late (neura_walk, qmt_fullbody); 4 and 6 Hz give the same.
    working_hz : signals are thinned to about this rate; eight samples of the fastest component.
    widest_s : lags looked at, either side.
    chunk_s, window_chunks : products are summed by chunk, a window is so many of them.
    least_chunks : of a window without a lost sample.
    windows : a longer take has its windows further apart, up to half a window; so many are enough.
    least_power : RMS of the joint's acceleration below which nobody moves, m/s².
    place_sd_m : how far from its sensor a joint may be; with noise_mps2 a weak prior that keeps solvable what
        hardly moves.
    attitude : of the tilt; 0.2/s forgets a wrong bias sooner than the orientation of the figure needs.
    """

    band_hz: tuple[float, float] = (0.5, 6.0)
    working_hz: float = 50.0
    widest_s: float = 0.16
    chunk_s: float = 1.0
    window_chunks: int = 6
    least_chunks: int = 5
    windows: int = 120
    least_power: float = 0.5
    place_sd_m: float = 0.4
    noise_mps2: float = 1.0
    attitude: AttitudeParams = field(default_factory=lambda: AttitudeParams(kp=0.2))


@dataclass(frozen=True)
class LagParams:
    """When a late sensor is told, and when it is repaired (docs/science/agreement.md, "Late sensors").

    Parameters
    ----------
    repair : False leaves the signals as they are; what is found is told all the same.
    least_s : of one sensor. least_group_s : of several with one clock, or where a hip alone speaks: clean
        hips of two people show up to 19 ms. warn_s : from here on a warning.
    z : lag over its spread, that of the joint included.
    hip_sd_s, knee_sd_s, ankle_sd_s : what skin and joint make of a clock without lag: standard deviations on
        neura_walk and qmt_fullbody; simulated people have 0.5, 0.2 and 0.4 ms.
    worst_residual : a joint that fits worse, of its own acceleration, says nothing about time.
    least_windows : fewer say nothing.
    drift_s, drift_z : change over the take that is told; the bias of a joint does not enter.
    """

    repair: bool = True
    least_s: float = 0.012
    least_group_s: float = 0.030
    warn_s: float = 0.025
    z: float = 3.0
    hip_sd_s: float = 0.009
    knee_sd_s: float = 0.004
    ankle_sd_s: float = 0.003
    worst_residual: float = 0.9
    least_windows: int = 3
    drift_s: float = 0.010
    drift_z: float = 4.0


@dataclass(frozen=True)
class AgreementParams:
    """Everything about what the sensors say of each other."""

    joints: JointParams = field(default_factory=JointParams)
    lags: LagParams = field(default_factory=LagParams)
