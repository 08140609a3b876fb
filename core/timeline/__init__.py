"""Packet counters and device clocks → ONE uniform axis and a validity mask per sensor, for files and
streams.
"""

from sagittal.core.timeline.params import TimelineParams
from sagittal.core.timeline.synchronise import synchronise

__all__ = ["TimelineParams", "synchronise"]
