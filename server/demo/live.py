"""Live patient of `sagittal demo`: a training with feedback, streamed as from a tablet.

Run as a module with the server's address after the visits are analysed. Only the walk is simulated: pairing
code, socket, acknowledgements and finish are those of any tablet.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import closing
from math import pi
from typing import TYPE_CHECKING, Any, Final

from sagittal.core.subject.condition import USUAL
from sagittal.server.clinic import patients, sessions
from sagittal.server.demo.clinic import STROKE
from sagittal.server.live.client import stream
from sagittal.server.live.pairing import pair
from sagittal.server.live.playback import DueBatch, cut, hello_of, pace_batches
from sagittal.server.live_takes import live
from sagittal.server.settings import Settings, load_settings
from sagittal.server.storage.db import Database
from sagittal.server.storage.schema.tables import now

if TYPE_CHECKING:
    from sagittal.core.signals.recording import Recording
    from sagittal.core.simulate import Simulation

TITLE: Final = "Gait training with feedback, live"
LAPS: Final = 10
GROWTH: Final = 0.025
"""Relative increase of step length per lap, as a learning effect."""
PER_BATCH: Final = 5


def plan_training(laps: int = LAPS, seed: int = 5) -> Simulation:
    """Laps of a corridor for about eight minutes, with step length increasing from lap to lap."""
    from sagittal.core.simulate import PATIENTS, Arc, Script, Stand, Straight, simulate
    from sagittal.core.simulate.script import scale_script
    from sagittal.core.simulate.scripts import ON_SKIN

    man = PATIENTS["hemi_mild"]
    walker = man.walker.scaled_to(STROKE.height_m)
    turn_m, turn_s = 0.8 * man.step_m, 1.05 * man.step_s
    course: list[Straight | Arc] = []
    for lap in range(laps):
        length = man.step_m * (1.0 + GROWTH * lap)
        for way in (pi, -pi):
            course += [Straight(16.0, length, man.step_s), Arc(1.2, way, turn_m, turn_s)]
    script: Script = (Stand(8.0), *course, Stand(5.0))
    return simulate(scale_script(script, walker.scale), walker, seed, ON_SKIN)


def open_take(settings: Settings) -> str:
    """Create a session with an open trial; return its pairing code."""
    with closing(Database(settings.database_source)) as db, db.write() as c:
        patient = next(p for p in patients.list_patients(c, None) if p.code == STROKE.code)
        day = now().date()
        session = sessions.create(c, None, patient.id, title=TITLE, performed_on=day, **USUAL.stated)
        return live.open_take(c, None, session.id)[1]


async def stream_walk(address: str, code: str, recording: Recording, speed: float = 1.0) -> None:
    """Stream a trial until its end or until the therapist stops it."""
    pairing = pair(address, code)
    stopped = asyncio.Event()

    def hear(message: Mapping[str, Any]) -> None:
        if message.get("type") == "command" and message.get("command") == "stop":
            stopped.set()

    frames = _until(stopped, cut(recording, PER_BATCH), speed)
    await stream(pairing.socket, pairing.token, hello_of(recording, pairing.take), frames, hear=hear)


async def _until(stopped: asyncio.Event, batches: Sequence[DueBatch], speed: float) -> AsyncIterator[bytes]:
    async for frame in pace_batches(batches, speed):
        if stopped.is_set():
            return
        yield frame


if __name__ == "__main__":
    walk = plan_training().recording  # takes a while; the trial opens when it can be streamed immediately
    asyncio.run(stream_walk(sys.argv[1], open_take(load_settings()), walk))
