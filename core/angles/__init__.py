"""Joint angles: one rotation sequence, one sign table (docs/science/joint-angles.md).

Joints: R = R_proximalᵀ R_distal = Rz(a) Rx(b) Ry(c), the joint coordinate system of Grood and Suntay 1983 in
ISB frames: a about the proximal medio-lateral axis, b about the floating axis, c about the distal long axis.
Pelvis: R_W_neutralᵀ R_pelvis = Ry(rotation) Rx(b) Rz(tilt), intrinsic Y-X-Z (Baker 2001), so that tilt and
obliquity do not depend on the direction of walking.

`sagittal.core.angles.measure` processes a recording; it requires numba, which readers of results do not need.
"""

from sagittal.core.angles.cardan import cardan_zxy, compute_headings, pelvis_angles
from sagittal.core.angles.result import SIGNS, JointAngles, list_leg_joints

__all__ = ["SIGNS", "JointAngles", "cardan_zxy", "compute_headings", "list_leg_joints", "pelvis_angles"]
