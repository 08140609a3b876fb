"""Stamps and counters of a file → true times of its rows, and what had to be repaired on the way."""

from sagittal.core.formats.clocks.repair import RepairedClock, repair_clock
from sagittal.core.formats.clocks.report import Repair

__all__ = ["Repair", "RepairedClock", "repair_clock"]
