"""What feedback needs of a stride."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from sagittal.core.frames import Floats, Side


class StrideLike(Protocol):
    """What is needed of a live stride (sagittal.core.online.LiveStride)."""

    @property
    def n(self) -> int:
        """Running number over both feet; the same stride may come twice, its distances last."""

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
        """Last sample that was needed."""

    @property
    def values(self) -> Mapping[str, float | None]:
        """Parameters of the stride."""

    @property
    def curves(self) -> Mapping[str, Floats]:
        """Variable → (101,) rad."""

    @property
    def counted(self) -> bool:
        """Nothing speaks against it: no turn, no gap."""
