"""Parameters of the functional tests hang together: one set for each part, and the analysis takes them."""

from __future__ import annotations

from dataclasses import fields

from sagittal.core.functional_tests.params import FunctionalTestParams
from sagittal.core.functional_tests.rising import RisingParams
from sagittal.core.functional_tests.sway import SwayParams
from sagittal.core.functional_tests.walks import WalkTestParams
from sagittal.core.pipeline.config import PipelineConfig


def test_every_part_has_its_own_published_parameters() -> None:
    params = FunctionalTestParams()
    assert (params.rising, params.sway, params.walks) == (RisingParams(), SwayParams(), WalkTestParams())
    assert {f.name for f in fields(params)} == {"rising", "sway", "walks"}
    changed = FunctionalTestParams(walks=WalkTestParams(cut_m=0.0))
    assert (changed.walks.cut_m, changed.sway) == (0.0, SwayParams())


def test_the_analysis_takes_them_as_one() -> None:
    assert FunctionalTestParams() in [getattr(PipelineConfig(), f.name) for f in fields(PipelineConfig)]
