"""force_plate_steps for tests: ten right steps of one adult with the force under the foot.

The steps are glued from a walk on a treadmill: there is no rest and no direction of walking. Pitch comes from
the gyroscope about the sensor's rightward axis, level in the middle of each stance; between the steps the
pitch of one goes over into that of the next in a tenth of a second.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from sagittal.core.events.foot_movement import FootMovement
from sagittal.core.frames import R_NEUTRAL, Floats
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import about, from_matrix, multiply
from tests.data import data_folder

RATE = 100.0
CONTACT_N = 20.0
JOIN = 10
"""Samples between two steps."""


@cache
def take() -> tuple[Orientations, FootMovement, Floats, Floats]:
    """The steps in a row as the right foot's orientation and motion; contacts and foot-offs by force, s."""
    path = data_folder("force_plate_steps", "steps_s1.csv")
    table = np.genfromtxt(path, delimiter=",", names=True)
    pitch: list[Floats] = []
    speed: list[Floats] = []
    acc: list[Floats] = []
    contact: list[float] = []
    off: list[float] = []
    first = 0
    for step in np.unique(table["step"]):
        part = table[table["step"] == step]
        rate = np.radians(np.stack([part[f"gyr_{a}"] for a in "xyz"], axis=1))
        # x points right: a rate about it turns the toes down
        turned = np.concatenate(([0.0], np.cumsum(-0.5 * (rate[1:, 0] + rate[:-1, 0])))) / RATE
        force = part["force_z_N"]
        up = np.flatnonzero((force[:-1] < CONTACT_N) & (force[1:] >= CONTACT_N))[0]
        down = np.flatnonzero((force[:-1] >= CONTACT_N) & (force[1:] < CONTACT_N))[-1]
        turned -= turned[(up + down) // 2]
        if pitch:
            bridge = np.linspace(pitch[-1][-1], turned[0], JOIN + 2)[1:-1]
            pitch.append(bridge)
            speed.append(np.full(JOIN, speed[-1][-1]))
            acc.append(np.repeat(acc[-1][-1:], JOIN, axis=0))
            first += JOIN
        for j, result in ((up, contact), (down, off)):
            result.append((first + j + (CONTACT_N - force[j]) / (force[j + 1] - force[j])) / RATE)
        pitch.append(turned)
        speed.append(np.linalg.norm(rate, axis=1))
        acc.append(np.stack([part[f"acc_{a}"] for a in "xyz"], axis=1))
        first += len(part)
    whole = np.concatenate(pitch)
    q = multiply(about(1, -whole), from_matrix(R_NEUTRAL))
    n = len(whole)
    orientations = Orientations(
        np.arange(n) / RATE, RATE, {"foot_r": q}, {"foot_r": np.ones(n, np.bool_)}, "force plate"
    )
    return (
        orientations,
        FootMovement(np.concatenate(speed), np.concatenate(acc)),
        np.array(contact),
        np.array(off),
    )
