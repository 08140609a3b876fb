"""Reference walk for a live avatar: the norm, or the mean of the patient's better side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Final

import msgspec
import numpy as np

from sagittal.core.angles import SIGNS, cardan_zxy, list_leg_joints, pelvis_angles
from sagittal.core.body.model import BodyModel
from sagittal.core.frames import SIDES, SUFFIX, Floats, Side
from sagittal.core.rotation import conjugate, multiply
from sagittal.server.viewer.live.moment import FigureMoment
from sagittal.server.viewer.reference import SAGITTAL, ReferenceWalk, add_standing_angles, find_better_side

MEAN_OF: Final = 5
"""Strides averaged per side: enough for a typical cycle, few enough to be current."""
SPEED_OF, SPEED_FROM = 10, 3
"""Strides whose mean speed selects the norm, and minimum number required: as on the page."""
SPEED_STEP_MPS: Final = 0.05
"""Speed steps of the norm, so that it does not change with every stride."""

NormAt = Callable[[float | None], Mapping[str, Floats]]
"""Gait speed in m/s, None = unknown → norm curves in rad; empty if none applies."""


class FeedStride(msgspec.Struct, frozen=True):
    """The fields of a stride message (server/live/wire.py) used here."""

    n: int
    side: Side
    counted: bool
    values: dict[str, float | None]
    curves_deg: dict[str, list[float | None]]


_told = msgspec.json.Decoder(FeedStride).decode


class LiveReference:
    """The reference walk of one patient.

    Parameters
    ----------
    norm : speed → variable → (n,) rad over the cycle, empty if no norm applies.
    trained : side of the prescription, if any; the other one is then the better side.
    """

    def __init__(self, body: BodyModel, norm: NormAt, trained: Callable[[], Side | None]) -> None:
        self._body, self._trained, self._norm_at = body, trained, norm
        self._walks: dict[str, ReferenceWalk | None] = {}
        self._strides: dict[int, FeedStride] = {}
        self._last: bytes = b""

    def find(
        self, choice: object, strides: tuple[bytes, ...], zero: Callable[[], Mapping[str, float]]
    ) -> ReferenceWalk | None:
        """The walk for the choice "norm" or "better" ("own"); None for others or if unavailable.

        Parameters
        ----------
        strides : the latest stride messages to browsers, in order; may contain duplicates.
        zero : returns angle → rad in standing, called when strides are averaged.
        """
        newest = strides[-1] if strides else b""
        if newest is not self._last:
            self._last = newest
            self._strides = {feed_stride.n: feed_stride for feed_stride in map(_told, strides)}
            self._walks.clear()
        key = str(choice)
        if key not in self._walks:
            self._walks[key] = self._walk(key, zero)
        return self._walks[key]

    def _walk(self, choice: str, zero: Callable[[], Mapping[str, float]]) -> ReferenceWalk | None:
        norm = self._norm()
        if choice == "norm":
            return ReferenceWalk(norm, self._body) if norm else None
        if choice not in ("better", "own"):
            return None
        means = {side: average_curves(s for s in self._strides.values() if s.side == side) for side in SIDES}
        trained = self._trained()
        side = _other(trained) if trained is not None else find_better_side(means, norm)
        if side is None or not all(name in means[side] for name in SAGITTAL):
            return None
        return ReferenceWalk(add_standing_angles(means[side], zero(), side), self._body, lead=side)

    def _norm(self) -> Mapping[str, Floats]:
        """Curves of healthy adults at the speed of recent strides."""
        strides = list(self._strides.values())[-SPEED_OF:]
        speeds = [v for s in strides if (v := s.values.get("gait_speed_mps")) is not None]
        speed = float(np.mean(speeds)) if len(speeds) >= SPEED_FROM else None
        norm = self._norm_at(None if speed is None else SPEED_STEP_MPS * round(speed / SPEED_STEP_MPS))
        return norm if all(name in norm for name in SAGITTAL) else {}


def average_curves(strides: Iterable[FeedStride]) -> dict[str, Floats]:
    """Return variable → mean curve (n,) in rad of recent included strides, for variables present in all."""
    last = [s.curves_deg for s in strides if s.counted][-MEAN_OF:]
    if not last:
        return {}
    shared = set.intersection(*(set(curves) for curves in last))
    means = {name: np.array([curves[name] for curves in last], np.float64).mean(axis=0) for name in shared}
    return {name: np.radians(mean) for name, mean in means.items() if np.isfinite(mean).all()}


def find_standing_angles(moment: FigureMoment, angles_deg: Mapping[str, float | None]) -> dict[str, float]:
    """Return angle → rad in standing: absolute angles of a pose minus its angles relative to standing."""
    raw: dict[str, float] = {}
    q = dict(zip(moment.segments, moment.q, strict=True))
    if "pelvis" in q:
        tilt, obliquity = pelvis_angles(q["pelvis"])
        raw |= {"pelvis_tilt": float(tilt), "pelvis_obliquity": float(obliquity)}
    for side in SIDES:
        for joint, proximal, distal in list_leg_joints(side):
            if proximal in q and distal in q:
                abc = cardan_zxy(multiply(conjugate(q[proximal]), q[distal])).tolist()
                for (name, right, left), x in zip(SIGNS[joint], abc, strict=True):
                    raw[f"{name}_{SUFFIX[side]}"] = (right if side == "right" else left) * x
    offsets = {
        name: x - np.radians(now) for name, x in raw.items() if (now := angles_deg.get(name)) is not None
    }
    return {name: float((x + np.pi) % (2 * np.pi) - np.pi) for name, x in offsets.items()}


def _other(side: Side) -> Side:
    return "right" if side == "left" else "left"
