"""signals.parquet: sensor signals on the common time axis, in sensor axes.

`<segment>_acc_x…z` (m/s²), `<segment>_gyr_x…z_dps`; a lost sample is null.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.server.report.files.columns import SCHEMA, ParquetColumn, parquet_file

NAME = "signals.parquet"


def signals_parquet(recording: UniformRecording) -> bytes:
    """Write the signals as input to calibration, neither filtered nor rotated."""
    columns: dict[str, ParquetColumn] = {}
    for segment, s in recording.sensors.items():
        columns |= {f"{segment}_acc_{c}": partial(_force, s, i) for i, c in enumerate("xyz")}
        columns |= {f"{segment}_gyr_{c}_dps": partial(_rate, s, i) for i, c in enumerate("xyz")}
    meta = {
        "schema": SCHEMA,
        "rate_hz": recording.rate_hz,
        "devices": {segment: s.device_id for segment, s in recording.sensors.items()},
    }
    return parquet_file(recording.t_s, columns, meta)


def _force(s: SensorSignals, axis: int, rows: slice) -> np.ndarray:
    return np.where(s.valid[rows], s.cut("acc", rows)[:, axis], np.nan).astype(np.float32)


def _rate(s: SensorSignals, axis: int, rows: slice) -> np.ndarray:
    return np.where(s.valid[rows], np.degrees(s.cut("gyr", rows)[:, axis]), np.nan).astype(np.float32)
