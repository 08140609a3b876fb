"""Orientations → gait events and the stride list."""

from sagittal.core.events.detection import detect, detect_contacts
from sagittal.core.events.flags import StrideParams
from sagittal.core.events.foot_contact import FootContactParams, compile_foot_contact_kernel
from sagittal.core.events.foot_pitch import FootPitchParams, compile_foot_pitch_kernel
from sagittal.core.events.foot_way import FootWayParams, compile_foot_way_kernel
from sagittal.core.events.strides import stride_list

__all__ = [
    "FootContactParams",
    "FootPitchParams",
    "FootWayParams",
    "StrideParams",
    "compile_foot_contact_kernel",
    "compile_foot_pitch_kernel",
    "compile_foot_way_kernel",
    "detect",
    "detect_contacts",
    "stride_list",
]
