"""Signal quality: inspection of an upload, assessment of sensors, and suggested segment labels."""

from __future__ import annotations

from sagittal.core.quality.assessment import (
    QualityParams,
    QualityReport,
    SensorQuality,
    assess,
    concern_paths_alone,
    find_shown_level,
)
from sagittal.core.quality.inspection import DeviceFacts, Inspection, describe
from sagittal.core.quality.suggestion import Suggestion, suggest, suggest_segments

__all__ = [
    "DeviceFacts",
    "Inspection",
    "QualityParams",
    "QualityReport",
    "SensorQuality",
    "Suggestion",
    "assess",
    "concern_paths_alone",
    "describe",
    "find_shown_level",
    "suggest",
    "suggest_segments",
]
