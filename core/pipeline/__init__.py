"""The whole chain: Recording → Analysis, in named stages.

`config` has the parameters of every stage, `analysis` what the stages give, `stages` the stages themselves,
`recipes` their order. The same code serves the command line, the worker and the tests.
"""

from core.pipeline.analysis import TakeAnalysis
from core.pipeline.config import PipelineConfig
from core.pipeline.recipes import ACTIVITY, SQUAT, TRUNK_ONLY, WALK, Progress, analyse, resume
from core.pipeline.stages import PipelineStage

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
