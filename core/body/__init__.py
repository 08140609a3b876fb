"""Orientations → Poses: segments, joints, lengths, forward kinematics."""
