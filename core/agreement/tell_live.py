"""Messages of the streaming consistency checks: nothing is corrected until the recording is analysed."""

from __future__ import annotations

from typing import Final

from sagittal.core.agreement.exchange import SensorExchange
from sagittal.core.agreement.lags import SensorLag
from sagittal.core.agreement.params import LagParams
from sagittal.core.agreement.slips import SensorSlip
from sagittal.core.agreement.tell import list_sensors, say_exchange, say_lag, say_slip
from sagittal.core.errors import Notice
from sagittal.core.message import Message

AGAIN: Final = "sensors_agree_again"

RESOLVED: Final = {
    "sensors_exchanged": "The sensors of {sensors} fit where they are worn now.",
    "sensor_slipped": "The sensor on {sensors} is back in its position from before the slip.",
}
"""Code of a notice → what is said when it no longer holds."""

CLOCK_AGREES: Final = "The clock of {sensors} agrees with the others now."
"""What is said when a clock that was late no longer is."""


def tell_lag_now(lag: SensorLag, params: LagParams, t_s: float) -> Notice:
    """Notice about a late clock."""
    if not lag.sure:
        todo = "Only one joint shows this. Synchronise the sensors and record again."
        return Notice(
            "clocks_disagree", Message("{lag}. {todo}", lag=say_lag(lag), todo=todo), lag.sensors[0], t_s
        )
    todo = "Adjacent joint angles are wrong in the live view; the analysis of the trial corrects them."
    if abs(lag.lag_s) <= params.warn_s:
        return Notice(
            "sensor_late", Message("{lag}. {todo}", lag=say_lag(lag), todo=todo), lag.sensors[0], t_s, "info"
        )
    return Notice(
        "sensor_late",
        Message("{lag}. {todo} Synchronise the sensors before the next trial.", lag=say_lag(lag), todo=todo),
        lag.sensors[0],
        t_s,
    )


def tell_exchange_now(exchange: SensorExchange, t_s: float) -> Notice:
    """Notice about swapped sensors."""
    return Notice(
        "sensors_exchanged",
        Message(
            "{exchange} The live avatar is wrong; the analysis of the trial corrects it. Correct the "
            "sensor assignment and calibrate again.",
            exchange=say_exchange(exchange),
        ),
        exchange.swap[0][0],
        t_s,
    )


def tell_slip_now(slip: SensorSlip) -> Notice:
    """Notice about a slipped sensor, with time and angle."""
    return Notice(
        "sensor_slipped",
        Message(
            "{slip} Adjacent joint angles are wrong from then on. Fasten the sensor and calibrate again.",
            slip=say_slip(slip),
        ),
        slip.segment,
        slip.at_s,
    )


def take_back(notice: Notice, sensors: tuple[str, ...], t_s: float) -> Notice:
    """Notice that an earlier notice no longer holds."""
    sentence = RESOLVED.get(notice.code, CLOCK_AGREES)
    return Notice(AGAIN, Message(sentence, sensors=list_sensors(sensors)), notice.sensor, t_s, "info")
