"""Orientations → Poses: segments, joints, lengths, forward kinematics."""

from core.body.contacts import contact_mask
from core.body.kinematics import forward_kinematics, nominal_body
from core.body.model import BodyModel

__all__ = ["BodyModel", "contact_mask", "forward_kinematics", "nominal_body"]
