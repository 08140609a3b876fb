"""Result of fusion: the orientation of every segment in the common world W."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from sagittal.core.errors import Notice
from sagittal.core.frames import Bools, Floats, Segment


class LastReading(dict[Segment, Floats]):
    """Orientations (n, 4) by segment for a final reader, which releases them after use."""

    def forget(self, segments: Iterable[Segment]) -> None:
        """Release these orientations; the segments keep their positions in the order."""
        self.update(dict.fromkeys(segments, np.empty((0, 4))))


@dataclass(frozen=True, eq=False)
class Orientations:
    """Segment orientations on the uniform axis.

    Parameters
    ----------
    t_s : (n,) seconds from recording start.
    q : segment → (n, 4) unit quaternions, scalar first, ISB segment axes to world W.
    valid : segment → (n,) False where the sensor was lost for more than 0.1 s.
    """

    t_s: Floats
    rate_hz: float
    q: Mapping[Segment, Floats]
    valid: Mapping[Segment, Bools]
    engine: str
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)
