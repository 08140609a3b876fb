"""Result of the body model: position and orientation of each segment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sagittal.core.body.health import HealthFinding
from sagittal.core.body.model import BodyModel
from sagittal.core.errors import Notice
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.signals.held_samples import SHORT


def figure_precision(samples: int) -> type[np.floating[Any]]:
    """Floating-point type of the poses: long recordings use that of the file, half of 850 MB for 6 h."""
    return np.float64 if samples <= SHORT else np.float32


@dataclass(frozen=True, eq=False)
class Poses:
    """Segment poses on the uniform axis.

    Parameters
    ----------
    q : segment → (n, 4) segment to world, scalar first.
    p : segment → (n, 3) position of the segment's origin, m, world W (floor at z = 0). Origins: pelvis
        mid-hip, thigh hip centre, shank knee centre, foot ankle centre
    (docs/reference/coordinate-systems.md). valid : (n,) all segments measured.
    contact : segment (feet) → (n,) True while the foot is considered on the floor.
    q, p : in single precision for long recordings (`figure_precision`).
    method : of an estimator in `sagittal.core.estimators`, or its NO_FIGURE.
    reduced : a stable code if a better estimator was impossible or not requested: "sensor_failed",
        "not_calibrated", "no_standing", "estimator_failed"; None for the best one with the available sensors.
        health : findings of the estimator on its result.
    """

    t_s: Floats
    rate_hz: float
    q: Mapping[Segment, Floats]
    p: Mapping[Segment, Floats]
    valid: Bools
    contact: Mapping[Segment, Bools]
    body: BodyModel
    method: str
    reduced: str | None = None
    health: tuple[HealthFinding, ...] = ()
    notices: tuple[Notice, ...] = ()
    diagnostics: Mapping[str, object] = field(default_factory=dict)
