"""Trials passed to the live sensor comparison in blocks, without the rest of the chain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sagittal.core.agreement.live import LiveAgreement
from sagittal.core.calibration.live_attempt import WornSensors
from sagittal.core.errors import Notice
from sagittal.core.frames import Floats
from sagittal.core.online.calibrating import LiveCalibrator
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.core.timeline.live import UniformBlock


def cut_blocks(recording: UniformRecording, sizes: Sequence[int] = (50,)) -> Iterator[UniformBlock]:
    """The take in blocks of these sizes in turn."""
    segments = list(recording.sensors.values())
    acc, gyr, valid = (
        np.stack(x, axis=1) for x in zip(*((s.acc, s.gyr, s.valid) for s in segments), strict=True)
    )
    first = count = 0
    while first < len(acc):
        k = slice(first, min(len(acc), first + sizes[count % len(sizes)]))
        yield UniformBlock(first, recording.t_s[k], acc[k], gyr[k], valid[k], ~valid[k])
        first, count = k.stop, count + 1


def find_standings(recording: UniformRecording) -> tuple[int, ...]:
    """Samples up to which all sensors were still, as live calibration detects them."""
    calibrator = LiveCalibrator(
        WornSensors(
            tuple(recording.sensors), recording.rate_hz, recording.subject, recording.protocol,
            recording.mounting,
        )
    )  # fmt: skip
    result: list[int] = []
    for block in cut_blocks(recording):
        done = calibrator.push(block)
        result += calibrator.drain_standings()
        if done is not None:
            break
    return tuple(result)


def listen(
    recording: UniformRecording, stood: Sequence[int], sizes: Sequence[int] = (50,)
) -> tuple[LiveAgreement, list[tuple[float, Notice]]]:
    """Notices with their times in s of the trial."""
    watch, notices = LiveAgreement(tuple(recording.sensors), recording.rate_hz), []
    for block in cut_blocks(recording, sizes):
        past = block.first + len(block)
        watch.push(block, tuple(x for x in stood if block.first < x <= past))
        notices += [(past / recording.rate_hz, notice) for notice in watch.compare()]
    return watch, notices


def walk_again(recording: UniformRecording, times: int) -> UniformRecording:
    """A take that begins and ends standing, so many times in a row."""

    def again(x: Floats) -> Floats:
        return np.concatenate((x,) * times)

    def whole(x: SensorSignals) -> SensorSignals:
        masks = (np.concatenate((v,) * times) for v in (x.valid, x.interpolated))
        return SensorSignals(x.device_id, again(x.acc), again(x.gyr), None, *masks)

    return UniformRecording(
        np.arange(times * len(recording.t_s)) / recording.rate_hz,
        recording.rate_hz,
        {s: whole(x) for s, x in recording.sensors.items()},
        recording.subject,
        recording.protocol,
        recording.mounting,
    )
