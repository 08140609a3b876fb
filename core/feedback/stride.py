"""Interface of strides used by feedback."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from sagittal.core.frames import Floats, Side


class StrideLike(Protocol):
    """Required properties of a live stride (sagittal.core.online.LiveStride)."""

    @property
    def n(self) -> int:
        """Running number over both feet; a stride may be repeated when its distances become available."""

    @property
    def side(self) -> Side:
        """Foot."""

    @property
    def start_s(self) -> float:
        """First contact."""

    @property
    def end_s(self) -> float:
        """Second contact."""

    @property
    def detected_s(self) -> float:
        """Last sample required."""

    @property
    def values(self) -> Mapping[str, float | None]:
        """Parameters of the stride."""

    @property
    def curves(self) -> Mapping[str, Floats]:
        """Variable → (101,) rad."""

    @property
    def counted(self) -> bool:
        """Whether the stride is counted: no turn, no gap."""
