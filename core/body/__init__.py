"""Orientations → Poses: segments, joints, lengths, forward kinematics."""

from sagittal.core.body.contacts import contact_mask
from sagittal.core.body.kinematics import forward_kinematics, nominal_body
from sagittal.core.body.model import BodyModel

__all__ = ["BodyModel", "contact_mask", "forward_kinematics", "nominal_body"]
