"""From the paths of sensors to a recording: errors, ranges, clock lags, lost packets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, pi
from typing import Final

import numpy as np

from sagittal.core.formats.draft import signal_digest
from sagittal.core.frames import Bools, Floats, Protocol, Segment
from sagittal.core.signals.recording import ImuStream, Recording, Subject
from sagittal.core.simulate.mems import DrawnErrors, add_sensor_errors, clip_signals
from sagittal.core.simulate.sensors import SensorPath, SimulatedSignals, ideal_signals
from sagittal.core.simulate.setup import RecordingSetup

FINE_RATE_HZ: Final = 400.0
"""The motion is worked out at least this fine, and at least four times as fine as the recording."""

BURST: Final = 3.0
"""Mean length of a run of lost packets, samples."""


class Draws:
    """Random numbers of one seed, a separate stream for each purpose: another noise level does not change
    the steps.
    """

    def __init__(self, seed: int) -> None:
        streams = np.random.SeedSequence(seed).spawn(6)
        self.steps, self.mounts, self.errors, self.losses, self.impacts, self.iron = (
            np.random.default_rng(s) for s in streams
        )


@dataclass(frozen=True, eq=False)
class Recorded:
    """Recorded sensor signals of a motion.

    Parameters
    ----------
    ideal : segment → signals at every sample of the common axis, without errors, lags or losses.
    sensor_q : segment → (n, 4) sensor to world at the same samples, including soft tissue and impacts.
        errors : segment → constant errors. clipped : segment → (n,) samples outside its range.
    first_counter : packet counter at t = 0, for rendering device files.
    """

    recording: Recording
    ideal: Mapping[Segment, SimulatedSignals]
    sensor_q: Mapping[Segment, Floats]
    errors: Mapping[Segment, DrawnErrors]
    clipped: Mapping[Segment, Bools]
    first_counter: int


def oversampling(rate_hz: float) -> int:
    """Ratio of the fine grid to the sample rate."""
    return max(4, ceil(FINE_RATE_HZ / rate_hz))


def record(
    paths: Mapping[Segment, SensorPath],
    setup: RecordingSetup,
    draws: Draws,
    height_m: float | None = None,
    protocol: Protocol = "walk",
) -> Recorded:
    """Record sensors moving along paths.

    Parameters
    ----------
    paths : segment → path on the common grid, finer than the recording by the factor `oversampling`.
    """
    every = oversampling(setup.rate_hz)
    north = float(draws.mounts.uniform(-pi, pi))
    first_counter = int(draws.mounts.integers(0, 1 << 16))
    first_id = int(draws.mounts.integers(0x00B40000, 0x00B4F000))
    ids = draws.mounts.permutation(np.arange(first_id, first_id + len(paths)))

    ideal: dict[Segment, SimulatedSignals] = {}
    errors: dict[Segment, DrawnErrors] = {}
    beyond: dict[Segment, Bools] = {}
    streams: dict[str, ImuStream] = {}
    segments: dict[str, Segment | None] = {}
    for (segment, path), number in zip(paths.items(), ids, strict=True):
        t = path.t_s[::every]
        ideal[segment] = measured = ideal_signals(path, every, setup.sampling, north, setup.dipoles)
        if late := sum(lag.late_s for lag in setup.lags if lag.segment == segment):
            measured = ideal_signals(path.delay(late), every, setup.sampling, north, setup.dipoles)
        beyond[segment] = np.zeros(len(t), bool)
        if setup.noise is not None:
            measured, errors[segment] = add_sensor_errors(
                measured, setup.noise, setup.rate_hz, draws.errors, draws.iron
            )
            measured, beyond[segment] = clip_signals(measured, setup.acc_range, setup.gyr_range)
        arrived = _arrived(t, segment, setup, draws.losses)
        if segment in setup.worn:
            device = f"{number:08X}"
            streams[device] = _stream(device, t, measured, arrived, setup.rate_hz)
            segments[device] = segment
    recording = Recording(
        streams=streams, segments=segments, subject=Subject(height_m=height_m), protocol=protocol
    )
    turned = {segment: path.q[::every] for segment, path in paths.items()}
    return Recorded(recording, ideal, turned, errors, beyond, first_counter)


def _arrived(t: Floats, segment: Segment, setup: RecordingSetup, rng: np.random.Generator) -> Bools:
    """Samples (n,) received: not lost in short runs, not inside a dropout."""
    arrived = np.ones(len(t), bool)
    if setup.packet_loss:
        # two states: a run starts so often that the wanted share is lost on average
        runs = rng.binomial(len(t), setup.packet_loss / BURST)
        starts = rng.integers(1, len(t), runs)
        for start, length in zip(starts, rng.geometric(1.0 / BURST, runs), strict=True):
            arrived[start : start + length] = False
    for gap in setup.dropouts:
        if gap.segment == segment:
            arrived &= (t < gap.start_s) | (t >= gap.end_s)
    return arrived


def _stream(device: str, t: Floats, signals: SimulatedSignals, arrived: Bools, rate_hz: float) -> ImuStream:
    acc, gyr, mag = (np.ascontiguousarray(a[arrived]) for a in (signals.acc, signals.gyr, signals.mag))
    return ImuStream(
        device_id=device,
        source=f"simulated_{device}",
        t_s=t[arrived],
        acc=acc,
        gyr=gyr,
        mag=mag,
        quat=None,
        rate_hz=rate_hz,
        clock="counter",
        digest=signal_digest(acc, gyr, mag),
    )
