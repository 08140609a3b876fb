"""Measurement uncertainty of parameters, in addition to the spread of their strides
(docs/science/uncertainty.md).

Declared here once, by kind of value, and referenced by the entries of the catalogue. All values are standard
uncertainties in the unit of the parameter, with the data they were measured on.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Final

from sagittal.core.message import Message


@dataclass(frozen=True)
class ContactWeights:
    """Weights of the contacts of a stride in a time: its derivative with respect to each.

    Parameters
    ----------
    start, off, end : contact, foot-off and next contact of the foot itself. other_off, other : foot-off and
        contact of the other foot in the stride.
    """

    start: int = 0
    off: int = 0
    end: int = 0
    other_off: int = 0
    other: int = 0


@dataclass(frozen=True)
class MeasurementErrors:
    """Measurement uncertainty of a parameter.

    Parameters
    ----------
    source : contributions, in words for users. contacts : None if independent of contact times.
    common : error common to both sides and all recordings: definitions, body model.
    own : error of one side in one recording, the same in all of its strides: alignment, calibration, path.
    random : error of a single stride.
    """

    source: str
    contacts: ContactWeights | None = None
    common: float = 0.0
    own: float = 0.0
    random: float = 0.0


def _times(weights: ContactWeights) -> MeasurementErrors:
    return MeasurementErrors("moments of contact", weights)


STRIDE: Final = _times(ContactWeights(start=-1, end=1))
STEP: Final = _times(ContactWeights(end=1, other=-1))
STANCE: Final = _times(ContactWeights(start=-1, off=1))
SWING: Final = _times(ContactWeights(off=-1, end=1))
INITIAL: Final = _times(ContactWeights(start=-1, other_off=1))
TERMINAL: Final = _times(ContactWeights(off=1, other=-1))
DOUBLE: Final = _times(ContactWeights(start=-1, off=1, other_off=1, other=-1))
SINGLE: Final = _times(ContactWeights(other_off=-1, other=1))

CADENCE: Final = MeasurementErrors("moments of contact")
"""Of both feet: what delays the steps of one side shortens those of the other."""

_PATH: Final = "path of the feet"
STRIDE_LENGTH: Final = MeasurementErrors(_PATH, common=0.008, own=0.006, random=0.017)
"""gaitmap_foot −1.5 ± 17 mm and +1.4 ± 12 mm, neura_walk +6 ± 8 mm; the mean of a walk rounded up."""
STEP_LENGTH: Final = MeasurementErrors(
    Message("{PATH}, linked through the pelvis", PATH=_PATH), common=0.011, own=0.010, random=0.016
)
"""neura_walk +4 ± 16 mm; virtual people within 25 mm."""
STEP_WIDTH: Final = MeasurementErrors(
    Message("{PATH}, linked; standing width", PATH=_PATH), common=0.015, own=0.012, random=0.010
)
"""neura_walk +15 ± 7 mm, and what a ruler between the ankles is read to."""
CIRCUMDUCTION: Final = MeasurementErrors(_PATH, common=0.010, own=0.006, random=0.004)
"""neura_walk +11 ± 4 mm."""
HEEL_CLEARANCE: Final = MeasurementErrors(
    Message("{PATH}, shape of the shoe", PATH=_PATH), common=0.008, own=0.006, random=0.009
)
TOE_CLEARANCE: Final = MeasurementErrors(
    Message("{PATH}, shape of the shoe", PATH=_PATH), common=0.008, own=0.006, random=0.006
)
"""gaitmap_foot +4 ± 9 and +3 ± 6 mm at most, with a shoe's shape found there; a shape by eye adds to it."""
SPEED: Final = MeasurementErrors(_PATH, common=0.010, own=0.006, random=0.024)
"""gaitmap_foot −8 ± 24 and −1 ± 24 mm/s."""


def _angle(source: str, common: float, own: float) -> MeasurementErrors:
    return MeasurementErrors(source, common=common, own=own, random=1.0)


def _range(errors: MeasurementErrors) -> MeasurementErrors:
    """Uncertainty of a range, the difference of two levels with possibly different errors."""
    return MeasurementErrors(
        errors.source, None, sqrt(2.0) * errors.common, sqrt(2.0) * errors.own, errors.random
    )


HIP: Final = _angle("calibration of pelvis and thigh", 2.7, 1.5)
KNEE: Final = _angle("calibration of thigh and shank", 3.5, 2.0)
ANKLE: Final = _angle("calibration of shank and foot", 2.3, 1.5)
"""Figures of neura_walk over standing against Vicon, of each side: RMS of what both sides share 3.0, 3.7,
2.4°, of what they do not 0.8, 1.6, 1.4°; the latter rounded up, being of one person."""
HIP_RANGE: Final = _range(HIP)
KNEE_RANGE: Final = _range(KNEE)
ANKLE_RANGE: Final = _range(ANKLE)
LEVELS: Final = {"hip_flexion": HIP, "knee_flexion": KNEE, "ankle_dorsiflexion": ANKLE}
"""Variable of the cycle curves → what its levels are known to."""
FOOT_PITCH_IC: Final = _angle("zero of the foot, moment of contact", 1.5, 1.5)
"""gaitmap_foot +1.2 and +0.1°; a contact 14 ms off is 2° where the foot comes down."""
FOOT_PITCH_TC: Final = _angle("zero of the foot, moment of foot-off", 2.0, 2.0)
TOE_OUT: Final = _angle("heading of the foot", 1.5, 2.5)
FOOT_TURN: Final = _angle("heading of the foot", 0.0, 1.0)
"""Own estimates, from headings (validation/report.md, "Headings on neura_walk")."""


TEST_TOTAL: Final = MeasurementErrors("first and last movement, from simulated people", own=0.04)
TEST_EDGE: Final = MeasurementErrors("segment boundaries, from simulated people", own=0.06)
"""Simulated timed up and go of the twelve virtual people (validation/accuracy/test_functional_tests.py),
rounded up; real people were not measured against a reference."""
