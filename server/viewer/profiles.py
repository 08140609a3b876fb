"""Tables of cross-sections of the avatar's parts, lofted by `body_parts`.

Columns: position along the part; centre of the section in x; extent forward, back and to either side. All in
thousandths of body height, except the position along a thigh or shank, in fractions of its length, so that a
long shank has its calf below the knee. Lengths follow Drillis and Contini (Winter 2009, fig 4.1: shoulders
0.818 H, chin 0.870 H above the floor, upper arm 0.186 H, hip width 0.191 H); girths are illustrative.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

THIGH: Final[Floats] = np.array(
    [
        (0, 0, 42, 50, 43),
        (0.1, 0, 47.5, 48.5, 45),
        (0.24, 0.5, 51, 45, 44.5),
        (0.42, 1, 49.5, 41.5, 41.5),
        (0.6, 0.5, 44, 36.5, 36.5),
        (0.78, 0, 37, 33, 32),
        (0.9, 0, 33.8, 31.5, 30.4),
        (1, 0, 33, 31, 30),
    ],
    np.float64,
)
"""Position: 0 hip centre, 1 knee centre. Quadriceps in front, thickest in the upper third."""

SHANK: Final[Floats] = np.array(
    [
        (0, 0, 28.5, 29, 27.2),
        (0.08, 0, 28.5, 31, 28.2),
        (0.18, -1, 27, 38.5, 30.8),
        (0.29, -2, 24.5, 43.5, 33),
        (0.42, -2, 22.8, 39.5, 31),
        (0.58, -1.5, 20.5, 29, 24.6),
        (0.76, -1, 18.2, 21.5, 18.4),
        (0.9, -0.5, 17.6, 19.5, 17.2),
        (1, 0, 18.5, 19, 19),
    ],
    np.float64,
)
"""Position: 0 knee centre, 1 ankle centre. Straight shin, calf at the back, malleoli at the end."""

FOOT: Final[Floats] = np.array(
    [
        (-250, -420, -760, 30, 30),
        (-244, -260, -890, 70, 70),
        (-226, -60, -965, 102, 101),
        (-180, 150, -1000, 124, 120),
        (-90, 340, -1000, 131, 123),
        (0, 380, -1000, 132, 121),
        (80, 220, -1000, 136, 122),
        (190, -40, -1000, 150, 132),
        (330, -290, -1000, 172, 158),
        (450, -460, -1000, 186, 180),
        (560, -590, -1000, 180, 178),
        (650, -660, -995, 150, 164),
        (715, -710, -975, 98, 128),
        (742, -790, -930, 48, 82),
        (750, -860, -900, 16, 40),
    ],
    np.float64,
)
"""Different columns. Position: along the foot, heel −250, toes 750, thousandths of its length; top and
bottom, in thousandths of the ankle height (−1000: the floor); extent outwards and inwards, of the length.
"""

PELVIS: Final[Floats] = np.array(
    [
        (-52, 3, 24, 28, 13),
        (-42, 2, 37, 44, 22),
        (-24, 0, 50, 57, 40),
        (-2, -1, 56, 63, 63),
        (18, -1, 58, 62, 80),
        (36, 0, 58, 57, 87),
        (54, 1, 57, 51, 87),
        (72, 1, 55, 46.5, 83),
    ],
    np.float64,
)
"""Position: above the hip centres. Cut high at the sides, so that the thighs are visible up to the hips."""

TRUNK: Final[Floats] = np.array(
    [
        (40, 1, 40, 32, 60),
        (60, 1, 48, 39.5, 71),
        (80, 1, 52, 43, 76),
        (102, 1, 54, 44.5, 77),
        (135, 1, 57, 47, 81),
        (172, 1, 62, 51, 88.5),
        (204, 0, 64, 56, 96),
        (230, -1, 60, 57, 106),
        (250, -3, 52, 53.5, 114),
        (264, -5, 45, 48.5, 113),
        (276, -6, 38.5, 43, 97),
        (285, -7, 34.5, 38.5, 75),
        (295, -8, 31.5, 34, 52),
        (307, -7, 30, 31, 38),
        (324, -4, 29, 30, 32),
        (350, 2, 29, 30, 31),
        (372, 5, 29, 30, 30),
    ],
    np.float64,
)
"""Position: above the hip centres. Waist, ribcage, shoulders, neck; both ends are hidden."""

HEAD: Final[Floats] = np.array(
    [
        (338, 28, 14, 15, 14),
        (343, 24, 22, 24, 22.5),
        (354, 18, 32, 34, 31),
        (371, 11, 41, 46, 37.5),
        (391, 6, 46.5, 55, 41.5),
        (410, 4, 48.5, 59, 43.5),
        (428, 2, 47.5, 58.5, 43.5),
        (446, 0, 40.5, 52, 38.5),
        (459, -2, 28.5, 38, 28),
        (467, -4, 14.5, 19, 14.5),
        (469.5, -5, 5, 6, 5),
    ],
    np.float64,
)
"""Position: above the hip centres. Chin, jaw, face, crown."""

ARM: Final[Floats] = np.array(
    [
        (0, 0, 23, 24, 21),
        (35, 0, 25, 25, 22.5),
        (80, 0, 24.5, 24, 21.5),
        (140, 0, 21.5, 21.5, 19.5),
        (186, 0, 19, 20, 19),
        (222, 0, 21, 20.5, 19),
        (270, 0, 17.5, 17, 15.5),
        (325, 0, 13.5, 13.5, 11),
        (345, 1, 16, 15, 11),
        (372, 3, 21, 19, 11),
        (405, 4, 18, 17, 9),
        (430, 3, 12, 12, 7),
    ],
    np.float64,
)
"""Position: below the shoulder centre; elbow at 186, wrist at 332, finger tips at 440."""

SHOULDER: Final = (-2.0, 258.0, 102.0)
"""Centre of the right shoulder: forward, up and right of the middle of the hips."""
