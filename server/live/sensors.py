"""Sensor status from the recorder alone, shown until the estimator provides its own (wire.py)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from sagittal.core.formats.live_log import Hello
from sagittal.server.live.messages import BATTERY_WARN_PCT


def sensor_rows(
    hello: Hello, heard: Collection[int], battery: Mapping[str, float], *, silent: bool
) -> list[dict[str, Any]]:
    """Rows like `health` of a frame; values that require an estimator are None.

    Parameters
    ----------
    heard : streams with samples. battery : sensor id → percent. silent : no data are being received.
    """
    rows = []
    for stream in hello.streams:
        for sensor in stream.sensors:
            percent = battery.get(sensor.id)
            if sensor.segment is None:
                state, words = "none", "not used"
            elif stream.stream not in heard:
                state, words = "none", "no data yet"
            elif silent:
                state, words = "bad", "silent"
            elif percent is not None and percent < BATTERY_WARN_PCT:
                state, words = "warn", "battery low"
            else:
                state, words = "ok", ""
            rows.append(
                {
                    "id": sensor.id,
                    "segment": sensor.segment,
                    "rate_hz": stream.rate_hz,
                    "lost_pct": None,
                    "still": None,
                    "battery_pct": percent,
                    "state": state,
                    "words": words,
                }
            )
    return rows
