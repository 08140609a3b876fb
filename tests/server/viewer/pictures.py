"""Estimator messages of the small kinematic walk, encoded like the estimator does."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sagittal.core.body.poses import Poses
from sagittal.core.frames import FOOT, SIDES, SUFFIX, Side
from sagittal.core.online.frame import LiveFrame
from sagittal.core.parameters.live.live_stride import LiveStride
from sagittal.server.live import wire
from sagittal.server.live.messages import Picture, encode_json
from tests.server import walk

RATE_HZ = 30.0
POSES: Poses = walk.poses(12.0, RATE_HZ)
ANGLES = walk.angles(12.0, RATE_HZ)


def frame(i: int, **changed: Any) -> LiveFrame:
    """The i-th frame."""
    result = LiveFrame(
        t_s=float(POSES.t_s[i]),
        seq=i,
        stage="running",
        method="erkf",
        q={s: q[i] for s, q in POSES.q.items()},
        p={s: p[i] for s, p in POSES.p.items()},
        valid=True,
        contact={s: bool(POSES.contact[FOOT[s]][i]) for s in SIDES},
        angles={name: float(x[i]) for name, x in ANGLES.angles.items()},
    )
    return replace(result, **changed)


def picture(i: int, take: str = "take", delay_s: float | None = 0.02, **changed: Any) -> Picture:
    """The i-th picture."""
    view = frame(i, **changed)
    phase = {s: 100.0 * ((view.t_s / walk.STRIDE_S + walk.PHASE[s]) % 1.0) for s in SIDES}
    body = wire.frame(view, (), {}, dict(phase))
    return Picture(take, view.t_s, view.seq, view.stage, body, delay_s, 0, wire.pose(view))


@dataclass(frozen=True)
class Leg:
    """Curves of a side: as walked, scaled."""

    side: Side
    scale: float = 1.0

    def curves(self) -> dict[str, np.ndarray]:
        """Variable → (101,) rad."""
        phase = np.linspace(0.0, 1.0, 101)
        result = {"hip_flexion": walk.HIP, "knee_flexion": walk.KNEE, "ankle_dorsiflexion": walk.ANKLE}
        return {name: self.scale * curve(phase) for name, curve in result.items()}


def stride(n: int, leg: Leg, *, counted: bool = True, speed_mps: float | None = 1.2) -> bytes:
    """Stride message for browsers."""
    notices = LiveStride(
        n=n,
        side=leg.side,
        start_s=float(n),
        foot_off_s=n + 0.6,
        end_s=n + 1.0,
        detected_s=n + 1.1,
        values={"gait_speed_mps": speed_mps},
        reasons={},
        curves=leg.curves(),
        turn_rad=0.0,
        flags=(),
        counted=counted,
        complete=True,
    )
    return encode_json(wire.stride(notices))


def suffixed(zero: dict[str, float], side: Side) -> dict[str, float]:
    """Standing angles with the side's ending."""
    return {f"{name}_{SUFFIX[side]}": x for name, x in zero.items()}
