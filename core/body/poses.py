"""What the body model gives: where each segment is and how it is turned."""

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
    """Of a figure of so many samples: a longer one is held as its file has it, at half of 850 MB for 6 h."""
    return np.float64 if samples <= SHORT else np.float32


@dataclass(frozen=True, eq=False)
class Poses:
    """Segment poses on the uniform axis.

    Parameters
    ----------
    q : segment → (n, 4) segment to world, scalar first.
    p : segment → (n, 3) position of the segment's origin, m, world W (floor at z = 0). Origins: pelvis
        mid-hip, thigh hip centre, shank knee centre, foot ankle centre
    (docs/reference/coordinate-systems.md). valid : (n,) all segments of the figure measured.
    contact : segment (feet) → (n,) True while the foot is taken to be on the floor.
    q, p : in single precision where the take is long (`figure_precision`).
    method : of an estimator of `sagittal.core.estimators`, or its NO_FIGURE.
    reduced : a stable code when a better estimator was not possible or not asked for: "sensor_failed",
        "not_calibrated", "no_standing", "estimator_failed"; None for the best one of the worn sensors.
    health : the estimator's own findings.
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
