"""CalibratedRecording → Orientations."""

from core.attitude import warm
from core.fusion.mahony import MahonyParams, estimate

__all__ = ["MahonyParams", "estimate", "warm"]
