"""From a script to a recording with its truth: the one door of the simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, pi
from typing import Final

import numpy as np

from core.errors import ParameterError
from core.formats.draft import signal_digest
from core.frames import Bools, Floats, Segment
from core.recording import ImuStream, Recording, Subject
from core.simulate.human import move
from core.simulate.script import Script, plan
from core.simulate.sensors import (
    MEMS,
    PLACES,
    DrawnErrors,
    Sampling,
    SensorNoise,
    Signals,
    draw_mounts,
    ideal_signals,
    with_errors,
)
from core.simulate.soft_tissue import SoftTissue
from core.simulate.truth import Truth, truth_of
from core.simulate.walker import Walker

FINE_RATE_HZ: Final = 400.0
"""The motion is worked out at least this fine, and at least four times as fine as the recording."""

BURST: Final = 3.0
"""Mean length of a run of lost packets, samples."""


@dataclass(frozen=True)
class Dropout:
    """One sensor lost from `start_s` to `end_s`."""

    segment: Segment
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Setup:
    """How it is recorded.

    Parameters
    ----------
    rate_hz : 20 to 1000. sampling : see `Sampling`. mount_spread_rad : sensors are turned by up to this.
    noise : None for ideal sensors. tissue : None for sensors fixed to the bone.
    packet_loss : share of lost samples, in short runs, 0 to 0.5.
    worn : the sensors that are recorded.
    """

    rate_hz: float = 100.0
    sampling: Sampling = "instant"
    mount_spread_rad: float = pi
    noise: SensorNoise | None = MEMS
    tissue: SoftTissue | None = None
    packet_loss: float = 0.0
    dropouts: tuple[Dropout, ...] = ()
    worn: tuple[Segment, ...] = tuple(PLACES)

    def __post_init__(self) -> None:
        if not 20.0 <= self.rate_hz <= 1000.0:
            raise ParameterError(
                "rate_range", f"Rate {self.rate_hz:g} Hz is outside the 20 to 1000 Hz we simulate."
            )
        if not 0.0 <= self.packet_loss <= 0.5:
            raise ParameterError("loss_range", f"Packet loss {self.packet_loss:g} is outside 0 to 0.5.")


@dataclass(frozen=True, eq=False)
class Simulation:
    """A recording, what really happened, and what ideal sensors would have measured.

    Parameters
    ----------
    ideal : segment → signals at every sample of `truth.t_s`, without errors or losses.
    first_counter : packet counter at t = 0, for rendering device files.
    """

    recording: Recording
    truth: Truth
    ideal: Mapping[Segment, Signals]
    first_counter: int

    def peaks(self) -> dict[Segment, tuple[float, float]]:
        """Segment → largest |specific force| in m/s² and |angular rate| in rad/s of the ideal signals."""
        return {
            segment: (
                float(np.linalg.norm(s.acc, axis=1).max()),
                float(np.linalg.norm(s.gyr, axis=1).max()),
            )
            for segment, s in self.ideal.items()
        }


def simulate(
    script: Script, walker: Walker | None = None, seed: int = 0, setup: Setup | None = None
) -> Simulation:
    """Let a walker do a script with seven sensors on; the same arguments give the same bits.

    Parameters
    ----------
    script : starts and ends with standing. walker : default is the healthy reference person.
    seed : of everything drawn. Steps, mounts, errors and losses have their own streams of random numbers, so
        another noise level does not change the steps.

    Raises
    ------
    ParameterError : "script_standing", "script_item", "step_too_long".
    """
    walker, setup = walker or Walker(), setup or Setup()
    of_steps, of_mounts, of_errors, of_losses = (
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(4)
    )
    every = max(4, ceil(FINE_RATE_HZ / setup.rate_hz))
    motion = move(plan(script, walker, of_steps), walker, every * setup.rate_hz)
    mounts = draw_mounts(walker, setup.mount_spread_rad, of_mounts)
    north = float(of_mounts.uniform(-pi, pi))
    first_counter = int(of_mounts.integers(0, 1 << 16))
    first_id = int(of_mounts.integers(0x00B40000, 0x00B4F000))
    ids = of_mounts.permutation(np.arange(first_id, first_id + len(PLACES)))

    t = motion.t_s[::every]
    ideal: dict[Segment, Signals] = {}
    errors: dict[Segment, DrawnErrors] = {}
    streams: dict[str, ImuStream] = {}
    worn: dict[str, Segment | None] = {}
    for segment, number in zip(PLACES, ids, strict=True):
        device = f"{number:08X}"
        ideal[segment] = ideal_signals(
            motion, segment, mounts[segment], setup.tissue, every, setup.sampling, north
        )
        measured = ideal[segment]
        if setup.noise is not None:
            measured, errors[segment] = with_errors(measured, setup.noise, setup.rate_hz, of_errors)
        arrived = _arrived(t, segment, setup, of_losses)
        if segment in setup.worn:
            streams[device] = _stream(device, t, measured, arrived, setup.rate_hz)
            worn[device] = segment
    recording = Recording(streams=streams, segments=worn, subject=Subject(height_m=walker.height_m))
    return Simulation(recording, truth_of(motion, every, mounts, errors, seed), ideal, first_counter)


def _arrived(t: Floats, segment: Segment, setup: Setup, rng: np.random.Generator) -> Bools:
    """Samples (n,) that reach the receiver: not lost in short runs, not inside a dropout."""
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


def _stream(device: str, t: Floats, signals: Signals, arrived: Bools, rate_hz: float) -> ImuStream:
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
