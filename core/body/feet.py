"""Paths of the feet, from which stride and step length, step width and clearance are measured."""

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
    valid : side → (n,) sensor data available.
    linked : both feet belong to one chain of sensors, so that their relative positions are known; False: each
        foot has its own origin and heading.
    source : `sagittal.core.estimators.LINKED_PATHS` or `SINGLE_PATHS`; or the corresponding live values.
    patched : side → (n,) packets were lost while the foot moved, and linear interpolation is insufficient.
    posture : posture that defines the neutral orientation and direction of the feet; toe-out is reported only
        for standing.
    sensor_ahead : side → estimated distance of the sensor in front of its nominal position, m, 0 if not
        given; the sole of a shoe is measured from the sensor.
    withheld : side → reason why distances of this foot are suppressed (core/angles/withheld.py).
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
