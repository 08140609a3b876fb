"""Sensitivity of joint angles to errors in body dimensions and in sensor position and orientation.

One at a time, 24 parameters, as Kianifar et al. 2019 (equation 1, tables 2 and 3); in addition to their
relative sensitivity the change of the error itself, for ± 5 % and for absolute steps that also exist where
the nominal value is 0 (docs/science/squat.md, "Sensitivity").
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import radians
from typing import Final

import numpy as np

from sagittal.core.angles import cardan_zxy
from sagittal.core.body.chain.filter import ChainFilter, ChainFilterParams
from sagittal.core.body.chain.geometry import LegGeometry
from sagittal.core.body.chain.leg import read_leg_signals
from sagittal.core.body.chain.model import build_leg_chain, leg_segments
from sagittal.core.calibration.fixed_offset import BACK, FRONT
from sagittal.core.calibration.standing_leg import find_standing_legs
from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import SUFFIX, Bools, Floats, Segment, Side
from sagittal.core.message import Message
from sagittal.core.rotation import about, from_matrix, to_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.squat.joints import JOINTS, name_joint_angles

UP, FORWARD, RIGHT = 1, 0, 2

LENGTHS: Final[Mapping[str, str]] = {
    "LTib2Knee": "tibia_to_knee",
    "CTib": "tibia_circumference",
    "Zr3S": "tibia_aside",
    "Ltibia": "tibia",
    "Yr3": "knee_forward",
    "Zr3": "knee_inward",
    "LThi2Knee": "thigh_to_knee",
    "CThi": "thigh_circumference",
    "Zr4S": "thigh_aside",
    "Lthigh": "thigh",
    "Yr4": "hip_forward",
    "Zr4": "hip_inward",
    "PW": "pelvis_width",
    "PD": "pelvis_depth",
    "LL": "leg_length",
}
"""The paper's name → field of `LegGeometry`."""

TURNS: Final[Mapping[str, tuple[int, int]]] = {
    "Roll-tib": (0, UP),
    "Pitch-tib": (0, FORWARD),
    "Yaw-tib": (0, RIGHT),
    "Roll-thi": (1, UP),
    "Pitch-thi": (1, FORWARD),
    "Yaw-thi": (1, RIGHT),
    "Roll-bac": (2, RIGHT),
    "Pitch-bac": (2, FORWARD),
    "Yaw-bac": (2, UP),
}
"""The paper's name → sensor from the foot up, and axis of its segment. The axes are not written there; they
are those for which tables 2 and 3 make sense: a roll of 45° on the shin is about the bone, yaw of shin and
thigh shows in flexion, on the back roll does."""

PARAMETERS: Final = (*LENGTHS, *TURNS)

LEAST_NOMINAL: Final = {"m": 1e-4, "rad": radians(0.1)}
"""A nominal value below this is 0: nothing can be 5 % off it."""
LEAST_ERROR: Final = radians(0.1)
"""An error below this cannot be divided by: the quotient says nothing of a person."""
GIMBAL: Final = radians(80.0)


@dataclass(frozen=True, eq=False)
class SquatCase:
    """One leg of a recording, with the reference for its angles.

    Parameters
    ----------
    gyr, acc : (n, 3, 3) rad/s, m/s² of shank, thigh and pelvis, bias-corrected, starting with standing.
    valid : (n, 3). rest_force : (3, 3) m/s² mean over standing.
    counted : (n,) samples for which errors are computed: all sensors available and the foot on the floor.
    reference : `JOINTS` → (n,) rad, anatomical or relative to standing; NaN where undefined.
    zero : samples whose mean is subtracted from the estimate if the reference is relative to standing, else
    None.
    """

    rate_hz: float
    geometry: LegGeometry
    mounts: Mapping[Segment, Floats]
    gyr: Floats
    acc: Floats
    valid: Bools
    rest_force: Floats
    counted: Bools
    reference: Mapping[str, Floats]
    zero: slice | None = None


@dataclass(frozen=True, eq=False)
class SensitivityRow:
    """One parameter; the seven angles in the order of `JOINTS`.

    Parameters
    ----------
    name : as in the paper. nominal : m or rad, None if undefined. unit : "m" or "rad".
    sensitivity_pct : (7,) of equation 1, mean of both directions; None with a `reason`:
    "parameter_nominal_zero" for a nominal value of 0, "gimbal" near a singularity of its angles. NaN if the
    error itself is too small to divide by, which includes the case without a reference.
    relative_rad : (7,) |change of the RMS error| at ± 5 %, mean of both directions; None likewise.
    step : m or rad. absolute_rad : (7,) the same at ± step.
    """

    name: str
    nominal: float | None
    unit: str
    sensitivity_pct: Floats | None
    relative_rad: Floats | None
    step: float
    absolute_rad: Floats
    reason: str | None = None


@dataclass(frozen=True, eq=False)
class SensitivityTable:
    """All parameters. errors : (7,) rad, RMS with nominal values."""

    errors: Floats
    relative: float
    rows: tuple[SensitivityRow, ...]


@dataclass(frozen=True, eq=False)
class ReferenceAngles:
    """Joint angles from an external reference system.

    Parameters
    ----------
    t_s : (m,) s on the recording's clock. angles : name with suffix → (m,) rad, anatomical or relative to
    standing.
    """

    t_s: Floats
    angles: Mapping[str, Floats]

    def list_missing(self, side: Side) -> list[str]:
        """Those of the seven angles of a leg that are missing."""
        names = (f"{joint}_{SUFFIX[side]}" for joint in JOINTS)
        return [name for name in names if name not in self.angles]


def make_case(
    calibrated: CalibratedRecording,
    geometry: LegGeometry,
    reference: ReferenceAngles | None,
    *,
    from_standing: bool,
    params: ChainFilterParams | None = None,
) -> SquatCase:
    """Create a case from one leg of a calibrated recording.

    Parameters
    ----------
    reference : None = the leg's own angles with nominal values, so that errors are pure changes.
    from_standing : compare angles relative to standing; a reference must already be so.

    Raises
    ------
    EstimationError `segments_missing`, `no_standing`, `no_reference`, `filter_diverged`.
    """
    side = geometry.side
    signals = read_leg_signals(calibrated, side)
    stands = find_standing_legs(calibrated)[side][signals.first :]
    case = SquatCase(
        rate_hz=calibrated.recording.rate_hz,
        geometry=geometry,
        mounts=signals.mounts,
        gyr=signals.gyr,
        acc=signals.acc,
        valid=signals.valid,
        rest_force=signals.rest_force,
        counted=signals.valid.all(axis=1) & stands,
        reference={},
        zero=signals.standing if from_standing else None,
    )
    if reference is None:
        return replace(case, reference=_estimate(case, geometry, case.mounts, params))
    if missing := reference.list_missing(side):
        raise EstimationError(
            "no_reference",
            Message(
                "The reference has no {missing}; it needs the seven angles of the leg.",
                missing=", ".join(missing),
            ),
        )
    times = calibrated.recording.t_s[signals.first :]
    reference_angles = {
        joint: np.interp(
            times, reference.t_s, reference.angles[f"{joint}_{SUFFIX[side]}"], left=np.nan, right=np.nan
        )
        for joint in JOINTS
    }
    if not all(np.isfinite(a[case.counted]).any() for a in reference_angles.values()):
        raise EstimationError("no_reference", "Reference and recording have no time in common.")
    return replace(case, reference=reference_angles)


def analyse_legs(
    calibrated: CalibratedRecording,
    geometries: Sequence[LegGeometry],
    reference: ReferenceAngles | None = None,
    *,
    from_standing: bool,
    params: ChainFilterParams | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> dict[Side, SensitivityTable]:
    """Run `analyse_sensitivity` for every leg with reference angles, or for all legs without a reference.

    Raises
    ------
    As `make_case` and `analyse_sensitivity`; `no_reference` if the reference has no leg of the recording.
    """
    legs = [g for g in geometries if reference is None or not reference.list_missing(g.side)]
    tables: dict[Side, SensitivityTable] = {}
    for k, geometry in enumerate(legs or geometries):
        case = make_case(calibrated, geometry, reference, from_standing=from_standing, params=params)

        def say(name: str, share: float, done: int = k) -> None:
            if progress is not None:
                progress(name, (done + share) / len(legs))

        tables[geometry.side] = analyse_sensitivity(case, params=params, progress=say)
    return tables


def analyse_sensitivity(
    case: SquatCase,
    relative: float = 0.05,
    step_m: float = 0.005,
    step_rad: float = radians(2.0),
    params: ChainFilterParams | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> SensitivityTable:
    """Run the chain with every parameter increased and decreased, one at a time.

    Parameters
    ----------
    relative : fraction of the nominal value. step_m, step_rad : absolute steps.
    progress : called with each parameter and the fraction of work completed.

    Raises
    ------
    ParameterError `parameter_out_of_range`; EstimationError `filter_diverged`.
    """
    if not (0.0 < relative < 1.0 and step_m > 0.0 and step_rad > 0.0):
        raise ParameterError("parameter_out_of_range", "Steps of a sensitivity analysis are above 0.")
    errors = _run(case, case.geometry, case.mounts, params)
    rows = []
    for i, name in enumerate(PARAMETERS):
        if progress is not None:
            progress(name, i / len(PARAMETERS))
        nominal, reason = _find_nominal(case, name)
        unit = "m" if name in LENGTHS else "rad"
        changes = pct = None
        if reason is None and nominal is not None:
            changes = _change(case, name, relative * nominal, errors, params)
            with np.errstate(invalid="ignore", divide="ignore"):
                pct = 100.0 * np.where(errors > LEAST_ERROR, changes / errors, np.nan) / relative
        step = step_m if unit == "m" else step_rad
        absolute = _change(case, name, step, errors, params)
        rows.append(SensitivityRow(name, nominal, unit, pct, changes, step, absolute, reason))
    return SensitivityTable(errors, relative, tuple(rows))


def _change(
    case: SquatCase, name: str, step: float, errors: Floats, params: ChainFilterParams | None
) -> Floats:
    """Mean |change of the errors| (7,) for a parameter changed by ± step."""
    changes = []
    for offset in (step, -step):
        geometry, mounts = _put_off(case, name, offset)
        changes.append(np.abs(_run(case, geometry, mounts, params) - errors))
    return np.asarray(0.5 * (changes[0] + changes[1]))


def _put_off(case: SquatCase, name: str, offset: float) -> tuple[LegGeometry, Mapping[Segment, Floats]]:
    """The model with one parameter changed by m or rad."""
    if name in LENGTHS:
        field = LENGTHS[name]
        return replace(case.geometry, **{field: getattr(case.geometry, field) + offset}), case.mounts
    sensor, axis = TURNS[name]
    segment = leg_segments(case.geometry.side)[sensor]
    turned = to_matrix(about(axis, offset)) @ case.mounts[segment]
    return case.geometry, {**case.mounts, segment: turned}


def _find_nominal(case: SquatCase, name: str) -> tuple[float | None, str | None]:
    """Nominal value, and the reason why a relative change is impossible."""
    if name in LENGTHS:
        value = float(getattr(case.geometry, LENGTHS[name]))
        return value, "parameter_nominal_zero" if abs(value) < LEAST_NOMINAL["m"] else None
    sensor, axis = TURNS[name]
    segment = leg_segments(case.geometry.side)[sensor]
    plain = BACK if segment == "pelvis" else FRONT
    turns = cardan_zxy(from_matrix(case.mounts[segment] @ plain.T))
    if abs(float(turns[1])) > GIMBAL:
        return None, "gimbal"
    value = float(turns[{RIGHT: 0, FORWARD: 1, UP: 2}[axis]])
    return value, "parameter_nominal_zero" if abs(value) < LEAST_NOMINAL["rad"] else None


def _run(
    case: SquatCase, geometry: LegGeometry, mounts: Mapping[Segment, Floats], params: ChainFilterParams | None
) -> Floats:
    """RMS errors (7,) of the angles, rad."""
    estimated = _estimate(case, geometry, mounts, params)
    off = np.stack([estimated[joint] - case.reference[joint] for joint in JOINTS])[:, case.counted]
    return np.asarray(np.sqrt(np.nanmean(off**2, axis=1)))


def _estimate(
    case: SquatCase, geometry: LegGeometry, mounts: Mapping[Segment, Floats], params: ChainFilterParams | None
) -> dict[str, Floats]:
    """`JOINTS` → angle (n,) rad, relative to standing if the case is."""
    chain = build_leg_chain(geometry, mounts)
    motion = ChainFilter(chain, case.rate_hz, case.rest_force, params).advance(case.gyr, case.acc, case.valid)
    named = name_joint_angles(motion.angles, geometry.side)
    by_joint = {joint: named[f"{joint}_{SUFFIX[geometry.side]}"] for joint in JOINTS}
    if case.zero is None:
        return by_joint
    return {joint: a - a[case.zero].mean() for joint, a in by_joint.items()}


def average_sensitivity(values: Sequence[Floats | None]) -> Floats:
    """Column means over defined values, as the last row of the paper's tables; NaN without any."""
    rows = np.array([v for v in values if v is not None]).reshape(-1, len(JOINTS))
    is_finite = np.isfinite(rows)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(is_finite, rows, 0.0).sum(axis=0) / is_finite.sum(axis=0))
