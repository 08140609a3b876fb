"""The whole chain: Recording → Analysis, in named stages.

`config` has the parameters of every stage, `analysis` their results, `stages` the stages themselves,
`recipes` their order. The same code is used by the command line, the worker and the tests.
"""

from sagittal.core.pipeline.analysis import TakeAnalysis
from sagittal.core.pipeline.config import PipelineConfig
from sagittal.core.pipeline.recipes import ACTIVITY, SQUAT, TRUNK_ONLY, WALK, Progress, analyse, resume
from sagittal.core.pipeline.stages import PipelineStage

__all__ = [
    "ACTIVITY",
    "SQUAT",
    "TRUNK_ONLY",
    "WALK",
    "PipelineConfig",
    "PipelineStage",
    "Progress",
    "TakeAnalysis",
    "analyse",
    "resume",
]  # fmt: skip
