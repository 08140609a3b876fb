"""Squats whose sensors start on a table."""

from __future__ import annotations

from functools import cache

import numpy as np

from sagittal.core.frames import Segment
from sagittal.core.rotation import multiply
from sagittal.core.signals.recording import ImuStream, Recording, Subject
from tests.core.body.chain.squats import HEIGHT_M, squat_on
from tests.core.calibration.test_table_top import RATE, WORN, carry


@cache
def from_table() -> Recording:
    """Squats of a take that begins on the table: three sensors are put on one after the other."""
    rng = np.random.default_rng(3)
    squats = squat_on("right", RATE, repetitions=2)
    streams: dict[str, ImuStream] = {}
    segments: dict[str, Segment | None] = {}
    for i, segment in enumerate(WORN):
        truth = squats.truth
        segment_names = multiply(truth.q[segment][0], truth.mounts[segment].q_segment_sensor)
        way, done = carry(segment_names, rng, None, 0.5, move_s=6.0), squats.ideal[segment]
        lying = np.zeros((round(3.0 * i * RATE), 3))
        standing = np.zeros((round(3.0 * (2 - i) * RATE), 3))
        bias = np.radians(0.5) * np.array([1.0, -1.0, 1.0])
        gyr = np.concatenate((lying + bias, way.gyr, standing + bias, done.gyr + bias))
        acc = np.concatenate((lying + way.acc[0], way.acc, standing + way.acc[-1], done.acc))
        noise = rng.normal(0.0, 0.005, (2, *gyr.shape))
        gyr, acc = gyr + 0.2 * noise[0], acc + noise[1]
        t = np.arange(len(gyr)) / RATE
        streams[segment] = ImuStream(segment, segment, t, acc, gyr, None, None, RATE, "counter", segment)
        segments[segment] = segment
    return Recording(streams, segments, Subject(HEIGHT_M), "squat")
