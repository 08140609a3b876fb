"""What the body model gives: where each segment is and how it is turned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from core.body.model import BodyModel
from core.errors import Notice
from core.frames import Bools, Floats, Segment


@dataclass(frozen=True, eq=False)
class Poses:
    """Segment poses on the uniform axis.

    Parameters
    ----------
    q : segment → (n, 4) segment to world, scalar first.
    p : segment → (n, 3) position of the segment's origin, m, world W (floor at z = 0). Origins: pelvis
        mid-hip, thigh hip centre, shank knee centre, foot ankle centre (spec/estimators.md §1).
    valid : (n,) all segments of the figure measured.
    contact : segment (feet) → (n,) True while the foot is taken to be on the floor.
    """

    t_s: Floats
    rate_hz: float
    q: Mapping[Segment, Floats]
    p: Mapping[Segment, Floats]
    valid: Bools
    contact: Mapping[Segment, Bools]
    body: BodyModel
    method: str
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)
