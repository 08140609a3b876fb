"""Parameters of all functional tests."""

from __future__ import annotations

from dataclasses import dataclass, field

from sagittal.core.functional_tests.rising import RisingParams
from sagittal.core.functional_tests.sway import SwayParams
from sagittal.core.functional_tests.walks import WalkTestParams


@dataclass(frozen=True)
class FunctionalTestParams:
    """Parameters of rises, quiet standing and walk tests; turns use `PipelineConfig.turns`."""

    rising: RisingParams = field(default_factory=RisingParams)
    sway: SwayParams = field(default_factory=SwayParams)
    walks: WalkTestParams = field(default_factory=WalkTestParams)
