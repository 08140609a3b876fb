"""The offline stages sample by sample: everything is a pure function of the samples in order."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sagittal.core.online.frame import AngleTrail, CalibrationView, LiveFrame, SegmentCheck, SensorHealth
from sagittal.core.parameters.live.live_stride import LiveStride

if TYPE_CHECKING:
    from sagittal.core.online.session import OnlineParams, OnlineSession, compile_live_kernels

__all__ = [
    "AngleTrail",
    "CalibrationView",
    "LiveFrame",
    "LiveStride",
    "OnlineParams",
    "OnlineSession",
    "SegmentCheck",
    "SensorHealth",
    "compile_live_kernels",
]


def __getattr__(name: str) -> object:
    """Lazy import of the estimator: it requires numba, which readers of frames do not need."""
    if name in ("OnlineSession", "OnlineParams", "compile_live_kernels"):
        from sagittal.core.online import session

        return getattr(session, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
