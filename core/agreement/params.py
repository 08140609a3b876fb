"""Parameters of the agreement of sensors: what is compared, and from where on something is told."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import radians

from sagittal.core.fusion.attitude import AttitudeParams


@dataclass(frozen=True)
class JointBandParams:
    """Which part of a joint's acceleration is looked at (docs/science/agreement.md, "One idea").

    Parameters
    ----------
    band_hz : of the acceleration. Below 0.5 Hz lies the error of the tilt, above 6 Hz the flesh: with bands
        up to 12 Hz clean knees seem 5 to 13 ms late (neura_walk, qmt_fullbody); 4 and 6 Hz give the same.
    working_hz : signals are thinned to about this rate; eight samples of the fastest component.
    """

    band_hz: tuple[float, float] = (0.5, 6.0)
    working_hz: float = 50.0


@dataclass(frozen=True)
class JointSumParams(JointBandParams):
    """How the two sources of that acceleration are compared, window by window.

    Parameters
    ----------
    chunk_s, window_chunks : products are summed by chunk, a window is so many of them.
    least_chunks : of a window without a lost sample.
    least_power : RMS of the joint's acceleration below which nobody moves, m/s².
    place_sd_m : how far from its sensor a joint may be; with noise_mps2 a weak prior that keeps solvable what
        hardly moves.
    """

    chunk_s: float = 1.0
    window_chunks: int = 6
    least_chunks: int = 5
    least_power: float = 0.5
    place_sd_m: float = 0.4
    noise_mps2: float = 1.0


@dataclass(frozen=True)
class JointParams(JointSumParams):
    """The same of sensors whose clocks may differ and whose tilt is not known.

    Parameters
    ----------
    widest_s : lags looked at, either side.
    windows : a longer take has its windows further apart, up to half a window; so many are enough.
    attitude : of the tilt; 0.2/s forgets a wrong bias sooner than the orientation of the figure needs.
    """

    widest_s: float = 0.16
    windows: int = 120
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
class ExchangeParams:
    """When sensors are said to be exchanged (docs/science/agreement.md, "Exchanged sensors").

    Parameters
    ----------
    repair : False leaves them on the segments that were declared; what is found is told all the same.
    over_s : so much of the walk is compared.
    ratio : another labelling fits so much better than the stated one: right ones have at most 0.84
        (neura_walk, qmt_fullbody) and 0.6 (simulated people), wrong ones at least 1.17.
    cosine : between the line of the hips and the right-hand side of walking, below which the legs are
        exchanged; as stated it is +0.91 and more (qmt_fullbody; others +0.97), exchanged the opposite.
    least_way_m : a swing that leads less far says nothing about the direction of walking.
    distinct : what is proposed beyond the exchanges fits so much better than the next best: the right order
        of seven sensors does by 1.16 (qmt_fullbody), 1.22 (neura_walk) and 1.5 (simulated people).
    mirrored : joints fit so much better with an accelerometer's signs turned round; right ones at most 1.03.
    worst_residual : a hip that fits worse, of its own acceleration, does not say where it lies; nor are signs
        turned round where a joint still fits worse. Right hips have at most 0.68 (qmt_fullbody), those of a
        gyroscope with wrong signs 1.2 and more.
    calmest : the pelvis turns at most so much more than the sensor that turns least (our choice).
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
    """When a slip is told, and when it is repaired (docs/science/agreement.md, "Slipped sensors").

    Parameters
    ----------
    repair : False leaves the signals as they are; what is found is told all the same.
    least_rad : smallest turn told, unwitnessed_rad more where too few strides confirm it.
    z : turn over the scatter of the windows, which is never taken less than floor_rad.
    near_s : windows so far from a moment speak about it. lasting : share of the turn that must be left over
        the whole take: else it came back.
    alone : largest turn of another sensor at the same time, over this one.
    alone_standing : the same from standing to walking and to standing. standing_sd_rad : how well such a slip
        is known: both legs walk alike within that (neura_walk, simulated people).
    agree : share of the turn that the strides must show, where there are `strides` on both sides; each side
        is the median of up to `near` of them.
    sure_rad : a larger turn at twice that z is told whatever the strides say.
    worst_residual : windows whose joint fits worse say nothing. least_swing : nor do those in which a leg
        sensor turns less, rad/s RMS. least_windows : on either side.
    judged : share of the walk at whose moments a slip would be seen; with less it is not said that a sensor
        stayed.
    misfit : places that also shrink or grow by more than this share did not turn but something else.
    within_s : strides so near to the change are left out, at least.
    straight_rad : strides that turn by more are no witnesses.
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
    """Everything about what the sensors say of each other."""

    joints: JointParams = field(default_factory=JointParams)
    exchange: ExchangeParams = field(default_factory=ExchangeParams)
    lags: LagParams = field(default_factory=LagParams)
    slips: SlipParams = field(default_factory=SlipParams)


@dataclass(frozen=True)
class LiveAgreementParams:
    """When what the joints show is told while samples come (docs/science/agreement.md, "Live").

    Parameters
    ----------
    agreement : limits, those of a file.
    least_windows : of every pair of sensors before labels are judged. patient_windows : of any pair, and what
        is missing is left out.
    confirmed : verdicts in a row, one a second, before something is told. cleared : without it before it is
        taken back. Both are our choice.
    pause_windows : walked after a pause in which a sensor may have slipped: standing up pulls clothes and
        sensors, and some of that comes back (qmt_fullbody).
    lag_windows : the last ones, from which lags are told.
    """

    agreement: AgreementParams = field(default_factory=AgreementParams)
    least_windows: int = 3
    patient_windows: int = 12
    confirmed: int = 3
    pause_windows: int = 8
    cleared: int = 5
    lag_windows: int = 20
