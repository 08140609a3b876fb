"""Orientations → gait events and the stride list."""

from core.events.detection import detect
from core.events.flags import StrideParams
from core.events.foot_pitch import FootPitchParams, compile_foot_pitch_kernel
from core.events.strides import stride_list

__all__ = ["FootPitchParams", "StrideParams", "compile_foot_pitch_kernel", "detect", "stride_list"]
