"""A simulated recording and its ground truth as tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import Simulation, angle_table, event_table, stride_table


@dataclass(frozen=True, eq=False)
class SimulatedWalk:
    """Result of `simulate`: the recording and its ground truth."""

    _simulation: Simulation

    @property
    def recording(self) -> Recording:
        """The simulated sensor recording, as input for `analyse`."""
        return self._simulation.recording

    @property
    def angles(self) -> pa.Table:
        """`t_s` and every joint angle as `<name>_deg`, relative to the standing posture."""
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
