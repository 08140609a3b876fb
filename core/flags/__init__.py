"""Clinical flags: measured values compared with published limits (docs/science/flags.md).

A flag states "swing peak of the left knee 38°, limit 44.3°", never a diagnosis. Limits on the absolute level
of an angle require the anatomical zero: without goniometer angles the standing posture would decide them.
"""

from sagittal.core.flags.judge import Flag, judge_flags
from sagittal.core.flags.rules import RULES, Rule, classify_ambulation

__all__ = ["RULES", "Flag", "Rule", "classify_ambulation", "judge_flags"]
