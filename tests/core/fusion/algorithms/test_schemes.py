"""Every way in which a gain may follow the motion is known where gains are made."""

from __future__ import annotations

from typing import get_args

from sagittal.core.fusion.algorithms.gain_space import choose_scheme
from sagittal.core.fusion.algorithms.gains import FixedGain, ThreeLevelGain, TwoLevelGain
from sagittal.core.fusion.algorithms.parameters import MadgwickGains
from sagittal.core.fusion.algorithms.presets import MADGWICK_ON_A_LEG
from sagittal.core.fusion.algorithms.schemes import Scheme


def test_each_scheme_makes_gains_of_its_own_kind() -> None:
    kinds = {}
    for scheme in get_args(Scheme):
        gains = choose_scheme(MadgwickGains(), scheme, magnetometer=True)
        assert isinstance(gains, MadgwickGains)
        kinds[scheme] = type(gains.beta)
    assert kinds == {"fixed": FixedGain, "two_levels": TwoLevelGain, "three_levels": ThreeLevelGain}


def test_gains_were_published_for_every_scheme() -> None:
    assert {scheme for scheme, _ in MADGWICK_ON_A_LEG} == set(get_args(Scheme))
