"""Gains of an algorithm as a point in a unit box, on a logarithmic scale of each tunable number.

Tunable numbers and their ranges are given by the types of `sagittal.core.fusion.algorithms.parameters`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from math import isinf, log
from typing import Any, Final, get_type_hints

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.gains import FixedGain, FuzzyGain, Gain, ThreeLevelGain, TwoLevelGain
from sagittal.core.fusion.algorithms.parameters import MAGNETIC, AlgorithmGains
from sagittal.core.fusion.algorithms.schemes import Scheme
from sagittal.core.fusion.algorithms.tuning_ranges import DEVIATION, TURNING, TuningRange
from sagittal.core.message import Message

DIGITS: Final = 4
"""Significant digits of a tuned gain: more would be noise of the data."""

THRESHOLDS: Final = {"acc": DEVIATION, "mag": DEVIATION, "gyr": TURNING}


@dataclass(frozen=True)
class _Variable:
    """One number: a field of the gains, location in a gain (None = the field itself), index in a tuple."""

    field: str
    part: str | None
    index: int | None
    limits: TuningRange


class GainSpace:
    """The tunable numbers of some gains; all others are constant.

    Parameters
    ----------
    params : initial gains; their levels are kept. magnetometer : whether one is used; without one its
        specific gains are constant, and thresholds on it are dropped.

    Raises
    ------
    ParameterError `nothing_to_tune`.
    """

    def __init__(self, params: AlgorithmGains, *, magnetometer: bool) -> None:
        ranges = _find_ranges(type(params), magnetometer)
        if not magnetometer:
            gains = {name: getattr(params, name) for name in ranges}
            params = _change(params, {n: _without_field(g) for n, g in gains.items() if isinstance(g, Gain)})
        self.params: AlgorithmGains = params
        self._variables = tuple(
            variable
            for name, limits in ranges.items()
            for variable in _list_variables(name, getattr(params, name), limits)
        )
        if not self._variables:
            raise ParameterError(
                "nothing_to_tune",
                Message("{type} has no gain that can be tuned.", type=type(params).__name__),
            )

    def __len__(self) -> int:
        return len(self._variables)

    def encode(self, params: AlgorithmGains) -> Floats:
        """The point (d,) of gains with the levels of this space; values outside their range are clipped."""
        return np.array([_to_unit(_read(params, v), v.limits) for v in self._variables])

    def decode(self, point: Floats) -> AlgorithmGains:
        """The gains at a point (d,), each rounded to four digits."""
        parts: dict[str, Any] = {}
        for v, x in zip(self._variables, point, strict=True):
            value = _from_unit(float(x), v.limits)
            if v.part is None:
                parts[v.field] = value
                continue
            inner = parts.setdefault(v.field, {})
            if v.index is None:
                inner[v.part] = value
            else:
                whole = inner.setdefault(v.part, list(getattr(getattr(self.params, v.field), v.part)))
                whole[v.index] = value
        return _change(self.params, {name: self._gain(name, part) for name, part in parts.items()})

    def _gain(self, name: str, part: float | dict[str, Any]) -> float | Gain:
        if isinstance(part, float):
            return part
        gain: Any = getattr(self.params, name)
        # thresholds in their order; corners are put in theirs by the gain itself
        inner = {
            k: tuple(sorted(x) if len(x) == 2 else x) if isinstance(x, list) else x for k, x in part.items()
        }
        changed: Gain = replace(gain, **inner)
        return changed


def choose_scheme(params: AlgorithmGains, scheme: Scheme, *, magnetometer: bool) -> AlgorithmGains:
    """The gains with a scheme for every adaptive gain, initially with equal levels.

    A gain of the gyroscope follows the rate, one of accelerometer or magnetometer its deviation, a gain of
    both follows both (Nazarahari 2021, Table 5).
    """
    changed: dict[str, Any] = {}
    for name in _find_ranges(type(params), magnetometer):
        gain = getattr(params, name)
        if isinstance(gain, Gain):
            changed[name] = _make_gain(_quiet(gain), scheme, _follows(name), magnetometer)
    return _change(params, changed)


def gains_to_json(params: AlgorithmGains) -> dict[str, Any]:
    """Gains by name: a number, or the levels and thresholds of a gain; infinite values are omitted."""
    return {f.name: x for f in fields(params) if (x := _to_plain(getattr(params, f.name))) is not None}


def _change(params: Any, values: Mapping[str, Any]) -> AlgorithmGains:
    """The same class of gains with other values; mypy cannot verify that the names are fields."""
    changed: AlgorithmGains = replace(params, **values)
    return changed


def _to_plain(value: Any) -> Any:
    if isinstance(value, FixedGain):
        return value.value
    if isinstance(value, float | int):
        return None if isinf(value) else value
    if isinstance(value, tuple):
        plain = [_to_plain(x) for x in value]
        return None if None in plain else plain
    if value is None:
        return None
    return {f.name: x for f in fields(value) if (x := _to_plain(getattr(value, f.name))) is not None}


def _find_ranges(gains: type[AlgorithmGains], magnetometer: bool) -> dict[str, TuningRange]:
    """Field → range, for those used with or without a magnetometer."""
    hints = get_type_hints(gains, include_extras=True)
    ranges = {}
    for f in fields(gains):
        notes = getattr(hints[f.name], "__metadata__", ())
        if notes and (magnetometer or MAGNETIC not in notes):
            ranges[f.name] = notes[0]
    return ranges


def _list_variables(name: str, value: Any, limits: TuningRange) -> list[_Variable]:
    if not isinstance(value, Gain):
        return [_Variable(name, None, None, limits)]
    variables: list[_Variable] = []
    for f in fields(value):
        part = getattr(value, f.name)
        inner = THRESHOLDS.get(f.name, limits)
        if isinstance(part, tuple):
            variables += [_Variable(name, f.name, i, inner) for i, x in enumerate(part) if not isinf(x)]
        elif isinstance(part, float) and not isinf(part):
            variables.append(_Variable(name, f.name, None, inner))
    return variables


def _read(params: AlgorithmGains, v: _Variable) -> float:
    value = getattr(params, v.field)
    if v.part is not None:
        value = getattr(value, v.part)
    return float(value if v.index is None else value[v.index])


def _to_unit(value: float, limits: TuningRange) -> float:
    x = min(max(1.0 - value if limits.left else value, limits.low), limits.high)
    return log(x / limits.low) / log(limits.high / limits.low)


def _from_unit(x: float, limits: TuningRange) -> float:
    value = float(f"{limits.low * (limits.high / limits.low) ** x:.{DIGITS}g}")
    return round(1.0 - value, 12) if limits.left else value


def _quiet(gain: Gain) -> float:
    """The value of a gain at rest."""
    if isinstance(gain, FixedGain):
        return gain.value
    if isinstance(gain, FuzzyGain):
        return gain.output[3]
    return gain.quiet


def _follows(name: str) -> tuple[str, ...]:
    if name == "sigma_g":
        return ("gyr",)
    if name.endswith("_a"):
        return ("acc",)
    return ("mag",) if name.endswith("_m") else ("acc", "mag")


def _make_gain(value: float, scheme: Scheme, follows: tuple[str, ...], magnetometer: bool) -> Gain:
    watched = [name for name in follows if name != "mag" or magnetometer]
    if scheme == "fixed" or not watched:
        return FixedGain(value)
    if scheme == "two_levels":
        return TwoLevelGain(value, value, **dict.fromkeys(watched, 0.1))
    return ThreeLevelGain(value, value, value, **dict.fromkeys(watched, (0.1, 0.2)))


def _without_field(gain: Gain) -> Gain:
    """The same gain without a threshold on the magnetometer; fixed if it followed nothing else."""
    if isinstance(gain, TwoLevelGain):
        without_mag = replace(gain, mag=np.inf)
        return FixedGain(gain.quiet) if isinf(without_mag.acc) and isinf(without_mag.gyr) else without_mag
    if isinstance(gain, ThreeLevelGain):
        rest3 = replace(gain, mag=(np.inf, np.inf))
        return FixedGain(gain.quiet) if isinf(rest3.acc[0]) and isinf(rest3.gyr[0]) else rest3
    return gain
