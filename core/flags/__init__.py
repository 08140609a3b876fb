"""Clinical flags: measured values against limits and where the limits come from (docs/science/flags.md).

A flag says "swing peak of the left knee 38°, limit 44.3°", never what a person has. Limits on the level of an
angle need the anatomical level: without goniometer angles the standing posture would decide them.
"""

from sagittal.core.flags.judge import Flag, judge_flags
from sagittal.core.flags.rules import RULES, Rule, classify_ambulation

__all__ = ["RULES", "Flag", "Rule", "classify_ambulation", "judge_flags"]
