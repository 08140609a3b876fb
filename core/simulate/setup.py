"""Recording set-up of a simulation: rate, sensors, their errors and failures."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from sagittal.core.errors import ParameterError
from sagittal.core.frames import SEGMENTS, Segment
from sagittal.core.simulate.gait.soft_tissue import SoftTissue
from sagittal.core.simulate.magnetics import Dipole
from sagittal.core.simulate.mems import ACC_RANGE, GYR_RANGE, MEMS, SensorNoise
from sagittal.core.simulate.sensors import Sampling


@dataclass(frozen=True)
class Dropout:
    """Data loss of one sensor from `start_s` to `end_s`."""

    segment: Segment
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Lag:
    """A sensor with a clock offset: samples show events `late_s` (−1 to 1) earlier than their time stamps."""

    segment: Segment
    late_s: float

    def __post_init__(self) -> None:
        if not abs(self.late_s) <= 1.0:
            raise ParameterError(
                "clock_offset_range",
                f"The clock at {self.segment} lags {self.late_s:g} s; expected −1 to 1 s.",
            )


@dataclass(frozen=True)
class RecordingSetup:
    """Recording set-up.

    Parameters
    ----------
    rate_hz : 20 to 1000. sampling : see `Sampling`. mount_spread_rad : maximum random rotation of sensors.
        noise : None for ideal sensors. tissue : None for sensors fixed to the bone. impacts : contacts of the
        feet make the sensors vibrate.
    acc_range, gyr_range : full scale per axis, m/s² and rad/s; larger values are clipped, as in real sensors.
        dipoles : ferromagnetic objects in the room. packet_loss : fraction of lost samples, in short runs, 0
        to 0.5. dropouts, lags : of single sensors. worn : the recorded sensors.
    """

    rate_hz: float = 100.0
    sampling: Sampling = "instant"
    mount_spread_rad: float = pi
    noise: SensorNoise | None = MEMS
    tissue: SoftTissue | None = None
    impacts: bool = False
    acc_range: float = ACC_RANGE
    gyr_range: float = GYR_RANGE
    dipoles: tuple[Dipole, ...] = ()
    packet_loss: float = 0.0
    dropouts: tuple[Dropout, ...] = ()
    lags: tuple[Lag, ...] = ()
    worn: tuple[Segment, ...] = SEGMENTS

    def __post_init__(self) -> None:
        if not 20.0 <= self.rate_hz <= 1000.0:
            raise ParameterError(
                "rate_range", f"Rate {self.rate_hz:g} Hz is outside the 20 to 1000 Hz we simulate."
            )
        if not 0.0 <= self.packet_loss <= 0.5:
            raise ParameterError("loss_range", f"Packet loss {self.packet_loss:g} is outside 0 to 0.5.")
        if not (self.acc_range > 0.0 and self.gyr_range > 0.0):
            raise ParameterError(
                "range_not_positive",
                f"Ranges {self.acc_range:g} m/s² and {self.gyr_range:g} rad/s; expected above 0.",
            )
