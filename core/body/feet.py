"""Where the feet go: what strides, steps, width and clearance are measured on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sagittal.core.body.model import BodyModel
from sagittal.core.frames import Bools, Floats, Posture, Side


@dataclass(frozen=True, eq=False)
class FootTracks:
    """Paths of the feet on the uniform axis.

    Parameters
    ----------
    p : side → (n, 3) ankle centre in W, m. q : side → (n, 4) foot axes to W, scalar first.
    still : side → (n,) the foot rests on the floor (zero velocity; shorter than contact).
    valid : side → (n,) the sensor was there.
    linked : both feet hang on one chain of sensors, so that their places relative to each other are known;
        False: each foot has its own origin and heading.
    source : `sagittal.core.estimators.LINKED_PATHS` or `SINGLE_PATHS`; live their live twins.
    patched : side → (n,) packets were lost while the foot moved, and a straight line says too little of it.
    posture : what the feet's neutral posture and direction are of; toe-out is told from standing alone.
    sensor_ahead : side → how far ahead of its nominal place the sensor was found to sit, m, 0 where not
        given; a shoe's sole is measured from the sensor.
    withheld : side → reason why no distance of this foot is told (core/angles/withheld.py).
    """

    t_s: Floats
    rate_hz: float
    p: Mapping[Side, Floats]
    q: Mapping[Side, Floats]
    still: Mapping[Side, Bools]
    valid: Mapping[Side, Bools]
    linked: bool
    source: str
    body: BodyModel
    withheld: Mapping[Side, str] = field(default_factory=dict)
    patched: Mapping[Side, Bools] = field(default_factory=dict)
    sensor_ahead: Mapping[Side, float] = field(default_factory=dict)
    posture: Posture = "standing"
