"""All laws that need the sensors' signals, on one recording; those of the contacts alone are in feet.py.

What they find is kept with the recording's tracks, so that it holds after an edit as well.
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
    """What the signals contradict; nothing where too little was walked to tell.

    Parameters
    ----------
    recording : after repair. events : contacts as detected. bouts : walking, by contacts or by the trunk.
    """
    working = drop_stuck_sensors(recording)
    rate_hz = working.rate_hz
    found: list[Doubt | None] = []
    trunk = next((s for s in TRUNK if s in working.sensors), None)
    if trunk is not None:
        found.append(judge_tilting(trunk, working.sensors[trunk], working.t_s, bouts, rate_hz))
    if "pelvis" in working.sensors:
        found.append(judge_echo(working.sensors["pelvis"], events, rate_hz))
    if events.events:
        found.append(judge_rate(working, treadmill=treadmill))
    return tuple(x for x in found if x is not None)
