"""Parameters of the consistency checks between sensors: comparison and reporting limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import radians

from sagittal.core.fusion.attitude import AttitudeParams


@dataclass(frozen=True)
class JointBandParams:
    """Frequency band of the joint acceleration used for comparison (docs/science/agreement.md, "One idea").

    Parameters
    ----------
    band_hz : of the acceleration. Below 0.5 Hz tilt error dominates, above 6 Hz soft-tissue movement: with
        bands up to 12 Hz error-free knees appear 5 to 13 ms late (neura_walk, qmt_fullbody); 4 and 6 Hz give
        equal results.
    working_hz : signals are decimated to about this rate: eight samples per period of the fastest component.
    """

    band_hz: tuple[float, float] = (0.5, 6.0)
    working_hz: float = 50.0


@dataclass(frozen=True)
class JointSumParams(JointBandParams):
    """Window-by-window comparison of the joint acceleration from both sides.

    Parameters
    ----------
    chunk_s, window_chunks : products are summed by chunk, a window consists of this many chunks.
        least_chunks : minimum number without a lost sample.
    least_power : RMS of the joint acceleration below which the person is not moving, m/s².
    place_sd_m : prior distance of a joint from its sensor; with noise_mps2 a weak prior that regularises
        small movements.
    """

    chunk_s: float = 1.0
    window_chunks: int = 6
    least_chunks: int = 5
    least_power: float = 0.5
    place_sd_m: float = 0.4
    noise_mps2: float = 1.0


@dataclass(frozen=True)
class JointParams(JointSumParams):
    """The same with unknown clock offsets and unknown tilt.

    Parameters
    ----------
    widest_s : largest lag considered, in either direction.
    windows : sufficient number of windows; longer recordings use a wider spacing, up to half a window.
    attitude : of the tilt filter; 0.2/s recovers from a wrong bias faster than the pose estimation requires.
    """

    widest_s: float = 0.16
    windows: int = 120
    attitude: AttitudeParams = field(default_factory=lambda: AttitudeParams(kp=0.2))


@dataclass(frozen=True)
class LagParams:
    """Reporting and correction of late sensors (docs/science/agreement.md, "Late sensors").

    Parameters
    ----------
    repair : False leaves the signals unchanged; notices are given all the same.
    least_s : minimum for one sensor. least_group_s : minimum for several with one clock, or with only a hip
        as evidence: error-free hips of two people show up to 19 ms. warn_s : threshold for a warning.
    z : minimum ratio of the lag to its spread, including that of the joint.
    hip_sd_s, knee_sd_s, ankle_sd_s : apparent lag caused by soft tissue and joint: standard deviations in
        neura_walk and qmt_fullbody; simulated people have 0.5, 0.2 and 0.4 ms.
    worst_residual : joints with a larger misfit, relative to their acceleration, are not used for lags.
    least_windows : minimum number of windows.
    drift_s, drift_z : reporting limits of the change over the recording, in which the constant lag of a joint
        cancels.
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
class ExchangeParams:
    """Criteria for swapped sensors (docs/science/agreement.md, "Exchanged sensors").

    Parameters
    ----------
    repair : False leaves them on the declared segments; notices are given all the same.
    over_s : duration of walking used for the comparison.
    ratio : minimum improvement of an alternative labelling over the declared one: correct labels have at most
        0.84 (neura_walk, qmt_fullbody) and 0.6 (simulated people), wrong labels at least 1.17.
    cosine : between the hip line and the right-hand side of the walking direction, below which the legs are
        swapped; it is at least +0.91 for correct labels (qmt_fullbody; others +0.97), the opposite for
        swapped legs.
    least_way_m : shorter swings are not used for the direction of walking.
    distinct : minimum improvement of a proposal other than a common swap over the next best: the right order
        of seven sensors has 1.16 (qmt_fullbody), 1.22 (neura_walk) and 1.5 (simulated people).
    mirrored : minimum improvement with inverted accelerometer signs; correct sensors have at most 1.03.
    worst_residual : hips with a larger misfit, relative to their acceleration, are not located, and signs are
        not inverted if a joint still has a larger misfit. Correct hips have at most 0.68 (qmt_fullbody),
        those with wrong gyroscope signs at least 1.2.
    calmest : maximum ratio of the rate of the pelvis to that of the calmest sensor (our choice).
    """

    repair: bool = True
    over_s: float = 60.0
    ratio: float = 1.1
    cosine: float = -0.5
    least_way_m: float = 0.15
    distinct: float = 1.1
    mirrored: float = 1.3
    worst_residual: float = 0.9
    calmest: float = 1.1


@dataclass(frozen=True)
class SlipParams:
    """Reporting and correction of sensor slip (docs/science/agreement.md, "Slipped sensors").

    Parameters
    ----------
    repair : False leaves the signals unchanged; notices are given all the same.
    least_rad : smallest reported rotation; unwitnessed_rad is added if too few strides confirm it.
    z : minimum ratio of the rotation to the scatter of the windows, which is at least floor_rad.
    near_s : windows within this distance of a moment are used. lasting : fraction of the rotation that must
        persist over the whole recording, otherwise it was temporary.
    alone : largest simultaneous rotation of another sensor, relative to this one.
    alone_standing : the same from standing to walking and to standing. standing_sd_rad : uncertainty of such
        a slip: symmetry of the two legs in walking (neura_walk, simulated people).
    agree : fraction of the rotation that the strides must confirm if there are at least `strides` before and
        after; each side is the median of up to `near` of them.
    sure_rad : a larger rotation at twice that z is reported regardless of the strides.
    worst_residual : windows with a larger joint misfit are ignored. least_swing : so are those with a lower
        rate of a leg sensor, rad/s RMS. least_windows : minimum before and after.
    judged : fraction of the walk in which a slip would be detected; below it a sensor is not reported as
        stable.
    misfit : maximum relative change of the joint positions not explained by the rotation; above it the change
        is no slip.
    within_s : minimum margin around the change in which strides are ignored.
    straight_rad : strides with a larger turn are not used.
    """

    repair: bool = True
    least_rad: float = radians(7.0)
    unwitnessed_rad: float = radians(2.0)
    z: float = 3.5
    floor_rad: float = radians(1.3)
    alone: float = 0.6
    alone_standing: float = 0.5
    standing_sd_rad: float = radians(3.0)
    near_s: float = 20.0
    lasting: float = 0.5
    agree: float = 0.5
    strides: int = 3
    sure_rad: float = radians(12.0)
    near: int = 4
    worst_residual: float = 0.75
    least_swing: float = 0.4
    least_windows: int = 2
    judged: float = 0.5
    misfit: float = 0.35
    within_s: float = 2.0
    straight_rad: float = radians(45.0)


@dataclass(frozen=True)
class AgreementParams:
    """Parameters of all consistency checks between sensors."""

    joints: JointParams = field(default_factory=JointParams)
    exchange: ExchangeParams = field(default_factory=ExchangeParams)
    lags: LagParams = field(default_factory=LagParams)
    slips: SlipParams = field(default_factory=SlipParams)


@dataclass(frozen=True)
class LiveAgreementParams:
    """Reporting of inconsistencies in a stream (docs/science/agreement.md, "Live").

    Parameters
    ----------
    agreement : limits, as for files.
    least_windows : windows of every sensor pair before labels are judged. patient_windows : windows of any
        pair, after which missing pairs are ignored.
    confirmed : consecutive verdicts, one per second, before a notice. cleared : consecutive verdicts without
        it before the notice is withdrawn. Both are our choice.
    pause_windows : windows of walking required after a pause in which a sensor may have slipped: standing up
        shifts clothes and sensors, partly reversibly (qmt_fullbody).
    lag_windows : number of the latest windows used for lags.
    """

    agreement: AgreementParams = field(default_factory=AgreementParams)
    least_windows: int = 3
    patient_windows: int = 12
    confirmed: int = 3
    pause_windows: int = 8
    cleared: int = 5
    lag_windows: int = 20
