"""Quaternions, rotation matrices and rotation vectors: on arrays (`arrays`) and one at a time (`compiled`).

Hamilton, scalar first (w, x, y, z); q maps body to world: v_W = q ⊗ v_B ⊗ q*. Source:
docs/reference/coordinate-systems.md, "Frames"; references in docs/science/orientation.md.

The functions of the package itself use numpy and accept arrays with any leading axes. Compiled loops import
`sagittal.core.rotation.compiled`, which requires numba; readers of results do not need it.
"""

from sagittal.core.rotation.arrays import (
    about,
    angle_between,
    conjugate,
    exp,
    find_lengths,
    find_middle,
    find_squares,
    find_vertical,
    from_matrix,
    log,
    mean,
    multiply,
    normalise,
    rotate,
    split_heading,
    to_matrix,
    wrap_angle,
    yaw,
)

__all__ = [
    "about", "angle_between", "conjugate", "exp", "find_lengths", "find_middle", "find_squares",
    "find_vertical", "from_matrix", "log", "mean", "multiply", "normalise", "rotate", "split_heading",
    "to_matrix", "wrap_angle", "yaw",
]  # fmt: skip
