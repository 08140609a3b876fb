"""Consistency checks of one recording from the sensors' signals; those of contacts alone are in feet.py.

Their results are stored with the recording's tracks, so that they remain valid after an edit.
"""

from __future__ import annotations

from collections.abc import Sequence

from sagittal.core.consistency.doubt import Doubt
from sagittal.core.consistency.echo import judge_echo
from sagittal.core.consistency.rate import judge_rate
from sagittal.core.consistency.walking import judge_tilting
from sagittal.core.events.bouts import Bout
from sagittal.core.events.lumbar import TRUNK
from sagittal.core.events.result import GaitEvents
from sagittal.core.quality.stuck import drop_stuck_sensors
from sagittal.core.signals.recording import UniformRecording


def judge_sensors(
    recording: UniformRecording, events: GaitEvents, bouts: Sequence[Bout], *, treadmill: bool = False
) -> tuple[Doubt, ...]:
    """Doubts raised by the signals of a recording; none if there is too little walking.

    Parameters
    ----------
    recording : after repair. events : contacts as detected. bouts : walking, by contacts or by the trunk.
    """
    working = drop_stuck_sensors(recording)
    rate_hz = working.rate_hz
    doubts: list[Doubt | None] = []
    trunk = next((s for s in TRUNK if s in working.sensors), None)
    if trunk is not None:
        doubts.append(judge_tilting(trunk, working.sensors[trunk], working.t_s, bouts, rate_hz))
    if "pelvis" in working.sensors:
        doubts.append(judge_echo(working.sensors["pelvis"], events, rate_hz))
    if events.events:
        doubts.append(judge_rate(working, treadmill=treadmill))
    return tuple(x for x in doubts if x is not None)
