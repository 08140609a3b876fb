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
        lost = ~s.valid[:, None]
        for name, values in (("acc", s.acc), ("gyr", np.degrees(s.gyr))):
            kept = np.where(lost, np.nan, values).astype(np.float32)
            unit = "_dps" if name == "gyr" else ""
            columns |= {f"{segment}_{name}_{c}{unit}": kept[:, i] for i, c in enumerate("xyz")}
    meta = {
        "schema": SCHEMA,
        "rate_hz": recording.rate_hz,
        "devices": {segment: s.device_id for segment, s in recording.sensors.items()},
    }
    return parquet_file(recording.t_s, columns, meta)
