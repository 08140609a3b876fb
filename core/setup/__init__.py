"""Errors in the sensor set-up of a recording: units, axes, signs and segment labels."""

from sagittal.core.setup.params import SetupParams
from sagittal.core.setup.propose import propose_repair
from sagittal.core.setup.repair import SetupRepair

__all__ = ["SetupParams", "SetupRepair", "propose_repair"]
