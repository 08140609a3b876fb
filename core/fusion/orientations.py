"""What fusion gives: the orientation of every segment in the common world W."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from core.errors import Notice
from core.frames import Bools, Floats, Segment


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
