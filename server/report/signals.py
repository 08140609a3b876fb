"""signals.parquet: what every sensor measured, on the common time axis, in the sensor's own axes.

`<segment>_acc_x…z` (m/s²), `<segment>_gyr_x…z_dps`; a lost sample is null.
"""

from __future__ import annotations

import numpy as np

from core.recording import UniformRecording
from server.report.columns import SCHEMA, parquet_file

NAME = "signals.parquet"


def signals_parquet(recording: UniformRecording) -> bytes:
    """Write the signals as they entered calibration: nothing filtered, nothing turned."""
    columns: dict[str, np.ndarray] = {}
    for segment, s in recording.sensors.items():
        # one axis at a time: whole signals would be held twice, and once more by Arrow
        for i, c in enumerate("xyz"):
            columns[f"{segment}_acc_{c}"] = np.where(s.valid, s.acc[:, i], np.nan).astype(np.float32)
        for i, c in enumerate("xyz"):
            rate = np.where(s.valid, np.degrees(s.gyr[:, i]), np.nan)
            columns[f"{segment}_gyr_{c}_dps"] = rate.astype(np.float32)
    meta = {
        "schema": SCHEMA,
        "rate_hz": recording.rate_hz,
        "devices": {segment: s.device_id for segment, s in recording.sensors.items()},
    }
    return parquet_file(recording.t_s, columns, meta)
