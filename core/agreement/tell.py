"""Messages of the consistency checks between sensors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sagittal.core.agreement.exchange import SensorExchange
from sagittal.core.agreement.lags import SensorDrift, SensorLag
from sagittal.core.agreement.params import ExchangeParams, LagParams, SlipParams
from sagittal.core.agreement.slips import SensorSlip
from sagittal.core.errors import Notice
from sagittal.core.message import Message

KEPT: Final = "The recording itself keeps its own times."


def say_lag(lag: SensorLag) -> str:
    """Message about a late clock."""
    ms, sd = 1e3 * abs(lag.lag_s), 1e3 * lag.sd_s
    verb, which = "is" if lag.sure else "seems", "late" if lag.lag_s > 0 else "early"
    return Message(
        "The clock of {sensors} {verb} {ms:.0f} ± {sd:.0f} ms {which}",
        sensors=list_sensors(lag.sensors),
        verb=verb,
        ms=ms,
        sd=sd,
        which=which,
    )


def tell_lag(lag: SensorLag, params: LagParams) -> Notice:
    """Notice about a late clock and its correction."""
    message = say_lag(lag)
    if not lag.sure:
        return Notice(
            "clocks_disagree",
            Message(
                "{said}. Only one joint shows this, so nothing was shifted. Synchronise the sensors and "
                "record again.",
                said=message,
            ),
            lag.sensors[0],
        )
    if not params.repair:
        return Notice(
            "sensor_late",
            Message(
                "{said}. It was not corrected, as this analysis was set to. Adjacent joint angles are wrong.",
                said=message,
            ),
            lag.sensors[0],
        )
    if abs(lag.lag_s) <= params.warn_s:
        return Notice(
            "sensor_late",
            Message("{said}; its samples were shifted accordingly. {KEPT}", said=message, KEPT=KEPT),
            lag.sensors[0],
            severity="info",
        )
    return Notice(
        "sensor_late",
        Message(
            "{said}; its samples were shifted accordingly. Synchronise the sensors before the next "
            "trial. {KEPT}",
            said=message,
            KEPT=KEPT,
        ),
        lag.sensors[0],
    )


def tell_drift(drift: SensorDrift, params: LagParams) -> Notice:
    """Notice about a clock that runs slow or fast."""
    ms, sd = 1e3 * abs(drift.change_s), 1e3 * drift.sd_s
    which = "slow" if drift.change_s > 0 else "fast"
    done = "its samples were realigned. " if params.repair else "it was not corrected. "
    return Notice(
        "clock_drifts",
        Message(
            "The clock of {sensor} runs {which}, by {ms:.0f} ± {sd:.0f} ms over the walk; "
            "{done}Synchronise the sensors before the next trial. {KEPT}",
            sensor=drift.sensor,
            which=which,
            ms=ms,
            sd=sd,
            done=done,
            KEPT=KEPT,
        ),
        drift.sensor,
    )


def say_exchange(exchange: SensorExchange) -> str:
    """Message about swapped sensors."""
    whose = " and ".join(f"{a} with {b}" for a, b in exchange.swap)
    return Message("Joint motion shows that sensors are swapped: {whose}.", whose=whose)


def tell_exchange(exchange: SensorExchange, params: ExchangeParams) -> Notice:
    """Notice about swapped sensors."""
    done = (
        "The trial was analysed with the corrected assignment. Check the sensors on the person and "
        "correct the assignment."
        if params.repair
        else "Nothing was changed, as this analysis was set to. Correct the sensor assignment."
    )
    return Notice(
        "sensors_exchanged",
        Message("{exchange} {done}", exchange=say_exchange(exchange), done=done),
        exchange.swap[0][0],
    )


def say_slip(slip: SensorSlip) -> str:
    """Message about a slipped sensor, with time and angle."""
    angle, sd = np.degrees(abs(slip.turn_rad)), np.degrees(slip.sd_rad)
    if slip.at_rest:
        return Message(
            "The sensor on {segment} slipped by {angle:.0f} ± {sd:.0f}° before the walk at {at_s:.0f} s, or "
            "its leg stood otherwise before than after it.",
            segment=slip.segment,
            angle=angle,
            sd=sd,
            at_s=slip.at_s + slip.within_s,
        )
    return Message(
        "The sensor on {segment} slipped by {angle:.0f} ± {sd:.0f}° about {at_s:.0f} s.",
        segment=slip.segment,
        angle=angle,
        sd=sd,
        at_s=slip.at_s,
    )


def tell_slip(slip: SensorSlip, params: SlipParams) -> Notice:
    """Notice about a slipped sensor, with time, angle and consequences."""
    if not params.repair:
        done = (
            "It was not corrected, as this analysis was set to. Adjacent joint angles are not reported "
            "from then on."
        )
    elif slip.at_rest:
        done = "It is excluded as if not worn. Fasten it and record again."
    elif slip.is_repaired:
        done = Message(
            "Adjacent joint angles within {within_s:.0f} s of the slip are excluded; later samples were "
            "corrected. Fasten it before the next trial.",
            within_s=slip.within_s,
        )
    else:
        done = Message(
            "From {max:.0f} s on it is excluded as if not worn. Fasten it and record again.",
            max=max(slip.at_s - slip.within_s, 0.0),
        )
    return Notice(
        "sensor_slipped",
        Message("{slip} {done}", slip=say_slip(slip), done=done),
        slip.segment,
        slip.at_s,
    )


def tell_left_over(lag: SensorLag) -> Notice:
    """Notice about a lag that remains after correction."""
    return Notice(
        "clocks_disagree",
        Message(
            "After correction {sensors} still appears {abs:.0f} ms out of sync with the others. Adjacent "
            "joint angles are unreliable; synchronise the sensors and record again.",
            sensors=list_sensors(lag.sensors),
            abs=1e3 * abs(lag.lag_s),
        ),
        lag.sensors[0],
    )


def list_sensors(sensors: Sequence[str]) -> str:
    """List sensors in a sentence.

    >>> list_sensors(["thigh_l", "shank_l", "foot_l"])
    'thigh_l, shank_l and foot_l'
    """
    return " and ".join(filter(None, (", ".join(sensors[:-1]), sensors[-1])))
