"""How much a parameter must change to exceed measurement error, and to be clinically important.

docs/science/change.md, "Limits and their sources". MDC: the minimal detectable change at 95 % unless its
source states otherwise. MCID: the minimal clinically important difference. Each limit was determined in a
certain population with a certain method; both are printed with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Final, Literal

import numpy as np

from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import CATALOGUE

Limb = Literal["affected", "unaffected"]

FEWEST: Final = 5
"""People measured twice below which there is no own limit (our choice)."""


@dataclass(frozen=True)
class ChangeLimit:
    """Smallest detectable or important change of one parameter.

    Parameters
    ----------
    value : in the unit of the parameter. people : population it was determined in. source : reference.
    """

    value: float
    people: str
    source: str


@dataclass(frozen=True)
class Repeatability:
    """Measurement error of a parameter, from people measured repeatedly without treatment.

    Parameters
    ----------
    sem : standard error of measurement, within people. mdc95 : 1.96 √2 sem. people, repeats : numbers it is
    based on.
    """

    sem: float
    mdc95: float
    people: int
    repeats: int

    @property
    def limit(self) -> ChangeLimit:
        """Return this repeatability as a limit of change."""
        return ChangeLimit(
            self.mdc95,
            Message("{people} people of this clinic", people=self.people),
            f"own repeated measurements, n = {self.people}",
        )


def estimate_repeatability(values: Sequence[Sequence[float]]) -> Repeatability | None:
    """Estimate measurement error from one list of values per person; None with fewer than five people
    measured twice.

    SEM² = pooled variance within people (Weir 2005, J Strength Cond Res 19:231).
    """
    repeated = [np.asarray(v, np.float64) for v in values if len(v) > 1]
    if len(repeated) < FEWEST:
        return None
    freedom = sum(len(v) - 1 for v in repeated)
    sem = sqrt(sum(float(((v - v.mean()) ** 2).sum()) for v in repeated) / freedom)
    return Repeatability(sem, _mdc95(sem), len(repeated), sum(len(v) for v in repeated))


def find_detectable_change(name: str, baseline: float, limb: Limb | None = None) -> ChangeLimit | None:
    """MDC of a parameter; None if no source reports one.

    Parameters
    ----------
    baseline : earlier value; limits for speed depend on the walking speed.
    limb : None = no affected side: the larger of the two limits.
    """
    entry = CATALOGUE.get(name)
    key = None if entry is None else entry.change
    if key == "speed":
        return next(limit for upper_mps, limit in _SPEED if baseline < upper_mps)
    if key in _BY_LIMB:
        return _of_limb(_BY_LIMB[key][0], limb)
    return None if key is None else _MDC[key]


def detectable_ratio(name: str) -> ChangeLimit | None:
    """MDC of the ratio affected / unaffected of a parameter."""
    return _RATIOS.get(name)


def find_relevant_change(name: str, limb: Limb | None = None) -> ChangeLimit | None:
    """MCID of a parameter or score; None if no source reports one."""
    entry = CATALOGUE.get(name)
    key = name if entry is None else entry.change
    if key in _BY_LIMB:
        return _of_limb(_BY_LIMB[key][1], limb)
    return None if key is None else _MCID.get(key)


def _mdc95(sem: float) -> float:
    return 1.96 * sqrt(2.0) * sem


def _of_limb(pair: tuple[ChangeLimit, ChangeLimit], limb: Limb | None) -> ChangeLimit:
    if limb is None:
        return max(pair, key=lambda limit: limit.value)
    return pair[0] if limb == "affected" else pair[1]


_CHRONIC: Final = "people in the chronic phase after stroke"
_LEWEK: Final = "Lewek 2019, MDC95 by speed before"
_SPEED: Final = (
    (0.4, ChangeLimit(0.10, _CHRONIC, _LEWEK)),
    (0.8, ChangeLimit(0.15, _CHRONIC, _LEWEK)),
    (float("inf"), ChangeLimit(0.18, _CHRONIC, _LEWEK)),
)
"""Speed below → limit."""

_KESAR: Final = "Kesar et al. 2011 (Gait Posture 33:314), treadmill"
_MDC: Final = {
    "step_length": ChangeLimit(0.067, _CHRONIC, Message("{KESAR}, affected side", KESAR=_KESAR)),
    "hip_extension": ChangeLimit(11.5, _CHRONIC, _KESAR),
    "angle": ChangeLimit(
        11.5, _CHRONIC, Message("{KESAR}: the largest of its joint angles, 3.8 to 11.5°", KESAR=_KESAR)
    ),
    "share": ChangeLimit(
        4.2, _CHRONIC, Message("{KESAR}: the largest of its temporal limits, 3.2 to 4.2 %", KESAR=_KESAR)
    ),
}
"""`ParameterEntry.change` → limit. Angles and shares of which only the range of all limits was read take its
largest."""

_GUZIK_KNEE: Final = "Guzik et al. 2020 (J Clin Med 9:3305)"
_GUZIK_HIP: Final = "Guzik et al. 2021 (Front Neurol 12:700190)"


def _pair(affected: float, unaffected: float, source: str) -> tuple[ChangeLimit, ChangeLimit]:
    return ChangeLimit(affected, _CHRONIC, source), ChangeLimit(unaffected, _CHRONIC, source)


def _from_sem(affected: float, unaffected: float, source: str) -> tuple[ChangeLimit, ChangeLimit]:
    return _pair(
        _mdc95(affected),
        _mdc95(unaffected),
        Message("{source}, 1.96 √2 of its error of measurement", source=source),
    )


_BY_LIMB: Final = {
    "knee_range": (_from_sem(1.86, 5.63, _GUZIK_KNEE), _pair(8.48, 6.81, _GUZIK_KNEE)),
    "hip_range": (_from_sem(1.56, 1.04, _GUZIK_HIP), _pair(5.81, 2.86, _GUZIK_HIP)),
}
"""`ParameterEntry.change` → MDC and MCID of the affected and the unaffected limb."""

_RATIO: Final = "Lewek & Randall 2011 (J Neurol Phys Ther 35:116), comfortable speed, affected / unaffected"
_RATIOS: Final = {
    "step_length_m": ChangeLimit(0.15, _CHRONIC, _RATIO),
    "swing_time_s": ChangeLimit(0.26, _CHRONIC, _RATIO),
    "stance_time_s": ChangeLimit(0.09, _CHRONIC, _RATIO),
}

_MCID: Final = {
    "speed": ChangeLimit(0.16, "people in the first months after stroke", "Tilson et al. 2010"),
    "gps_deg": ChangeLimit(1.6, "children", "Baker et al. 2012"),
}
"""`ParameterEntry.change`, or the name of a score → limit."""
