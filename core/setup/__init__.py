"""Mistakes in the set-up of a take: units, axes and signs of sensors, and who wears what."""

from sagittal.core.setup.params import SetupParams
from sagittal.core.setup.propose import propose_repair
from sagittal.core.setup.repair import SetupRepair

__all__ = ["SetupParams", "SetupRepair", "propose_repair"]
