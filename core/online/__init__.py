"""The same stages as offline, sample by sample: everything is a pure function of the samples in order."""

from __future__ import annotations

from typing import TYPE_CHECKING

from core.online.frame import CalibrationView, LiveFrame, SegmentCheck, SensorHealth, Trail
from core.parameters.live_stride import LiveStride

if TYPE_CHECKING:
    from core.online.session import Online, OnlineParams, warm

__all__ = [
    "CalibrationView",
    "LiveFrame",
    "LiveStride",
    "Online",
    "OnlineParams",
    "SegmentCheck",
    "SensorHealth",
    "Trail",
    "warm",
]


def __getattr__(name: str) -> object:
    """The estimator itself, on demand: it brings numba, which readers of frames do without."""
    if name in ("Online", "OnlineParams", "warm"):
        from core.online import session

        return getattr(session, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
