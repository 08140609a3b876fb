"""A clinic's own control group: references from sessions of healthy people, measured with the same sensors.

No corrections for different zero, foot-off definition or spread are necessary, since the measurement is the
same. The selection of permitted sessions (consent, health) happens earlier; this module is only arithmetic.
Each person counts once, however many sessions there are.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from sagittal.core.events.result import COMPARED
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.message import Message
from sagittal.core.norms.kinematics import NormBand
from sagittal.core.norms.lookup import Norms
from sagittal.core.norms.profile import SAGITTAL, CurveReference, MeanCurves, gather_curves, leave_one_out
from sagittal.core.norms.speed import walking_speed
from sagittal.core.norms.values import NormValue, Sex
from sagittal.core.parameters.kinematic import MEAN_ZERO, mean_curve
from sagittal.core.parameters.result import CycleCurves, Parameter
from sagittal.core.parameters.variability import has_enough_values
from sagittal.core.plurals import plural

FEWEST: Final = 5
"""People below which there is no group (our choice; percentiles allow for small groups, see `place`)."""

FEW: Final = 20
"""Groups smaller than this say so (our choice)."""

Range = tuple[float, float]
Values = Mapping[tuple[str, Side | None], float]


@dataclass(frozen=True, eq=False)
class ControlSession:
    """One session of a healthy person.

    Parameters
    ----------
    person : code of the person, equal in all their sessions.
    parameters : of the session. curves : mean curves of the counted strides, degrees relative to standing.
    """

    person: str
    age: float | None
    sex: Sex | None
    parameters: Sequence[Parameter]
    curves: MeanCurves

    @property
    def speed_mps(self) -> float | None:
        """Walking speed of the session."""
        return next((p.mean for p in self.parameters if p.name == "gait_speed_mps"), None)


@dataclass(frozen=True, eq=False)
class ControlGroup:
    """References derived from a clinic's own controls.

    Parameters
    ----------
    n : people. group, source : printed with every value. values, bands : as for the shipped tables.
        reference : for scores; None without joint angles. reason : "few_controls" below five people, without
        any reference; None otherwise. note : "small_group" below twenty.
    """

    n: int
    group: str
    source: str
    values: Mapping[str, NormValue] = field(default_factory=dict)
    bands: Mapping[str, NormBand] = field(default_factory=dict)
    reference: CurveReference | None = None
    reason: str | None = None
    note: str | None = None

    def norms(self, speed_mps: float | None = None, height_m: float | None = None) -> Norms:
        """The group as the reference for a person."""
        speed = None if speed_mps is None else walking_speed(speed_mps, height_m)
        return Norms(
            speed,
            None,
            self.values,
            bands=self.bands,
            reason=self.reason,
            timing_reason=self.reason,
        )


def control_group(
    sessions: Sequence[ControlSession],
    name: str = "own controls",
    age: Range | None = None,
    sex: Sex | None = None,
    speed_mps: Range | None = None,
) -> ControlGroup:
    """Derive references from the matching sessions; a session with unknown age, sex or speed does not match
    if that is a criterion.

    Parameters
    ----------
    age, speed_mps : minimum and maximum, inclusive. sex : None = both.
    """
    people: dict[str, list[ControlSession]] = {}
    for s in sessions:
        if _within(s.age, age) and _within(s.speed_mps, speed_mps) and sex in (None, s.sex):
            people.setdefault(s.person, []).append(s)
    n = len(people)
    group = ", ".join(
        part
        for part in (
            name,
            sex or "",
            "" if age is None else f"{age[0]:g} to {age[1]:g} years",
            "" if speed_mps is None else f"{speed_mps[0]:g} to {speed_mps[1]:g} m/s",
        )
        if part
    )
    source = Message(
        f"{{value}} {plural(n, 'control', 'controls')} of this clinic, same sensors and method", value=n
    )
    if n < FEWEST:
        return ControlGroup(n, group, source, reason="few_controls")
    values = [_mean_values(s) for s in people.values()]
    curves = [_mean_curves(s) for s in people.values()]
    bands = _bands(curves, group, source)
    reference = CurveReference(
        {v: b.mean_deg for v, b in bands.items()}, leave_one_out(curves), "standing", n, group, source
    )
    return ControlGroup(
        n,
        group,
        source,
        _values(values, group, source),
        bands,
        reference if bands else None,
        note="small_group" if n < FEW else None,
    )


def mean_curves(curves: CycleCurves, estimated: Collection[str] = ()) -> MeanCurves:
    """Mean curves of the counted strides in degrees, as stored in a control session; none with too few
    strides.

    Without quiet standing curves have no absolute level, and none are returned.

    Parameters
    ----------
    estimated : variables not measured by two sensors, which cannot serve as a reference.
    """
    means: dict[Side, dict[str, Floats]] = {}
    if curves.zero != "standing":
        return means
    for variable, sides in curves.curves.items():
        for side in () if variable in estimated else sides:
            mean = mean_curve(curves, variable, side)
            if mean.mean is not None and mean.n >= COMPARED:
                means.setdefault(side, {})[variable] = np.degrees(mean.mean)
    return means


def _within(value: float | None, limits: Range | None) -> bool:
    return limits is None or (value is not None and limits[0] <= value <= limits[1])


def _mean_values(sessions: Sequence[ControlSession]) -> Values:
    """A person's mean of every measured parameter over all sessions with enough strides."""
    collected: dict[tuple[str, Side | None], list[float]] = {}
    for s in sessions:
        for p in s.parameters:
            if p.mean is not None and has_enough_values(p) and not p.estimated:
                collected.setdefault((p.name, p.side), []).append(p.mean)
    return {key: v[0] if len(v) == 1 else float(np.mean(v)) for key, v in collected.items()}


def _mean_curves(sessions: Sequence[ControlSession]) -> MeanCurves:
    collected: dict[Side, dict[str, list[Floats]]] = {}
    for s in sessions:
        for side, curves in s.curves.items():
            for variable, curve in curves.items():
                collected.setdefault(side, {}).setdefault(variable, []).append(curve)
    return {
        side: {v: c[0] if len(c) == 1 else np.mean(c, axis=0) for v, c in own.items()}
        for side, own in collected.items()
    }


def _values(people: Sequence[Values], group: str, source: str) -> dict[str, NormValue]:
    """Mean over people and sides; sd of one side between people; sd of left − right."""
    # name → side → person → value
    by_name: dict[str, dict[Side | None, dict[int, float]]] = {}
    for person, p in enumerate(people):
        for (name, side), value in p.items():
            by_name.setdefault(name, {}).setdefault(side, {})[person] = value
    norm_values: dict[str, NormValue] = {}
    for name, by_side in by_name.items():
        sides = [by_side.get(s, {}) for s in (None, *SIDES)]
        columns = [np.array(list(by_person.values())) for by_person in sides if len(by_person) >= FEWEST]
        if not columns:
            continue
        _, left, right = sides
        differences = [x - right[person] for person, x in left.items() if person in right]
        norm_values[name] = NormValue(
            name=name,
            mean=float(np.mean([np.mean(c) for c in columns])),
            sd=float(np.sqrt(np.mean([np.var(c, ddof=1) for c in columns]))),
            n=min(len(c) for c in columns),
            group=group,
            source=source,
            difference_sd=float(np.std(differences, ddof=1)) if len(differences) >= FEWEST else None,
        )
    return norm_values


def _bands(people: Sequence[MeanCurves], group: str, source: str) -> dict[str, NormBand]:
    bands: dict[str, NormBand] = {}
    for variable in dict.fromkeys(v for p in people for own in p.values() for v in own):
        gathered = gather_curves(people, variable)
        means = gathered.means()
        if len(means) < FEWEST:
            continue
        sides = [gathered.curves[gathered.there[:, k], k] for k in range(len(SIDES))]
        spread = [np.var(rows, axis=0, ddof=1) for rows in sides if len(rows) > 1]
        bands[variable] = NormBand(
            variable=variable,
            mean_deg=np.mean(means, axis=0),
            sd_deg=np.sqrt(np.mean(spread, axis=0)),
            n=len(means),
            group=group,
            source=source,
            zero="stride_mean" if variable in MEAN_ZERO else "standing",
            confidence="normal" if variable in SAGITTAL else "low",
            note="",
        )
    return bands
