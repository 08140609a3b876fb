"""A simulated take and its truth as tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import Simulation, angle_table, event_table, stride_table


@dataclass(frozen=True, eq=False)
class SimulatedWalk:
    """What `simulate` gives: the recording, and what really happened."""

    _simulation: Simulation

    @property
    def recording(self) -> Recording:
        """What the sensors measured; `analyse` takes it."""
        return self._simulation.recording

    @property
    def angles(self) -> pa.Table:
        """`t_s`, and per joint angle `<name>_deg`, zero = the posture of standing."""
        found = angle_table(self._simulation.truth)
        return pa.table({"t_s": found.pop("t_s"), **{f"{k}_deg": np.degrees(v) for k, v in found.items()}})

    @property
    def events(self) -> pa.Table:
        """`time_s`, `side`, `kind` (ic, tc) and `source` of every contact."""
        return pa.table(event_table(self._simulation.truth))

    @property
    def strides(self) -> pa.Table:
        """One row per stride: `side`, times in s, length and width in m, `turn_rad`."""
        return pa.table(stride_table(self._simulation.truth))
