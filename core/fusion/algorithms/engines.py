"""From an algorithm's gains to the compiled loop of its engine and its state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Final

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms import (
    complementary,
    direction,
    error_state,
    extended_kalman,
    quaternion_kalman,
    sigma_point,
)
from sagittal.core.fusion.algorithms.gains import (
    LEVELS,
    LONGEST_WINDOW,
    OUTPUT,
    WIDTH,
    FixedGain,
    Gain,
    InnovationRules,
)
from sagittal.core.fusion.algorithms.parameters import AlgorithmGains
from sagittal.core.message import Message
from sagittal.core.rotation import conjugate, rotate

GAINS_RATE_HZ: Final = 100.0
"""Rate for which gains per sample are given."""

Run = Callable[[Floats, Floats, Floats, Floats, Floats], None]
"""(gyr, acc, mag, state, out): advance the state in place and write q (n, S, 4)."""


@dataclass(frozen=True)
class Setting:
    """Initial conditions of a filter.

    Parameters
    ----------
    q : (S, 4) sensor to world. m_ref : (S, 3) unit field of the world. has_mag : whether one is measured.
    """

    params: AlgorithmGains
    rate_hz: float
    q: Floats
    m_ref: Floats
    has_mag: bool

    def rows(self, names: Sequence[str], convert: Callable[[str, Floats], Floats]) -> Floats:
        """Gains (g, 42) in the order of names; zero for those the algorithm does not have."""
        gain_rows = []
        for name in names:
            gain: Gain = getattr(self.params, name, FixedGain(0.0))
            row = gain.row()
            for part in (LEVELS, OUTPUT):
                row[part] = convert(name, row[part])
            gain_rows.append(row)
        return np.array(gain_rows).reshape(-1, WIDTH)

    def constants(self, names: Sequence[str]) -> dict[str, float]:
        """Numbers by name; zero for those the algorithm does not have."""
        return {name: float(getattr(self.params, name, 0.0)) for name in names}

    def noise_rows(self, names: Sequence[str]) -> Floats:
        """Gains that are sample noises: white noise of the same density at every rate."""
        return self.rows(names, lambda _, values: values * sqrt(self.rate_hz / GAINS_RATE_HZ))

    def decay(self, share: float) -> float:
        """Fraction left after a sample at this rate, for one given at 100 Hz."""
        return float(share ** (GAINS_RATE_HZ / self.rate_hz))

    def drive(self, variance: float, share: float) -> float:
        """Variance added per sample at this rate that preserves the stationary spread."""
        if share >= 1.0:
            return variance * GAINS_RATE_HZ / self.rate_hz
        return variance * (1.0 - self.decay(share) ** 2) / (1.0 - share**2)


@dataclass(frozen=True)
class Prepared:
    """A filter ready to run: state (S, size), loop, and position of the gyroscope bias in the state."""

    state: Floats
    run: Run
    bias: int | None


def prepare_complementary(kind: str, setting: Setting) -> Prepared:
    """E1."""
    shares = complementary.FRACTIONS.get(kind, ())
    ratio = GAINS_RATE_HZ / setting.rate_hz

    def convert(name: str, values: Floats) -> Floats:
        if name not in shares:
            return values
        if (values > 1.0).any():
            raise ParameterError(
                "gain_out_of_range", Message("Gain {name} is a share of an error: 0 to 1.", name=name)
            )
        return np.asarray(1.0 - (1.0 - values) ** ratio)

    rows = setting.rows(complementary.GAINS[kind], convert)
    values = setting.constants(complementary.CONSTANTS[kind])
    for name in values:
        values[name] = float(convert(name, np.array([values[name]]))[0])
    if not setting.has_mag:
        values |= dict.fromkeys(complementary.LEARNS_BIAS.get(kind, ()), 0.0)
    constants = np.array([*values.values(), 0.0])
    state = np.zeros((len(setting.q), complementary.SIZE))
    state[:, :4] = setting.q
    number, dt = complementary.KINDS.index(kind), 1.0 / setting.rate_hz

    def run(gyr: Floats, acc: Floats, mag: Floats, state: Floats, out: Floats) -> None:
        complementary.run_complementary(number, gyr, acc, mag, dt, setting.m_ref, rows, constants, state, out)

    return Prepared(state, run, complementary.BIAS)


def prepare_quaternion_kalman(kind: str, setting: Setting) -> Prepared:
    """E2."""
    rows = setting.noise_rows(quaternion_kalman.GAINS)
    values = setting.constants(quaternion_kalman.CONSTANTS)
    values |= {name: setting.decay(values[name]) for name in ("c_a", "c_d")}
    constants = np.array([*values.values()])
    adaptation: InnovationRules | None = getattr(setting.params, "adaptation", None)
    window, rules = 0, np.zeros(WIDTH)
    if adaptation is not None:
        ratio = setting.rate_hz / GAINS_RATE_HZ
        window, rules = min(max(round(adaptation.window * ratio), 1), LONGEST_WINDOW), adaptation.row()
        rules[OUTPUT] *= ratio
    start = values["p0"], rows[0, 0] ** 2
    state = np.array([quaternion_kalman.start_state(kind, q, *start) for q in setting.q])
    number, dt = quaternion_kalman.KINDS.index(kind), 1.0 / setting.rate_hz

    def run(gyr: Floats, acc: Floats, mag: Floats, state: Floats, out: Floats) -> None:
        quaternion_kalman.run_quaternion_kalman(
            number, window, rules, gyr, acc, mag, dt, setting.m_ref, rows, constants, state, out
        )

    return Prepared(state, run, None)


def prepare_extended_kalman(kind: str, setting: Setting) -> Prepared:
    """E3."""
    blocks = extended_kalman.find_blocks(kind, setting.has_mag)
    rows = setting.noise_rows(extended_kalman.GAINS)
    values = setting.constants(extended_kalman.CONSTANTS)
    values |= {name: setting.decay(values[name]) for name in ("c_a", "c_d")}
    if values["gamma"] == 0.0:
        values["gamma"] = np.inf
    constants = np.array([*values.values()])
    state = np.array([extended_kalman.start_state(blocks, q, values["p0"]) for q in setting.q])
    places, dt, quasi_static = (
        extended_kalman.place_blocks(blocks),
        1.0 / setting.rate_hz,
        kind == "quasi_static",
    )

    def run(gyr: Floats, acc: Floats, mag: Floats, state: Floats, out: Floats) -> None:
        extended_kalman.run_extended_kalman(
            quasi_static, places, gyr, acc, mag, dt, setting.m_ref, rows, constants, state, out
        )

    return Prepared(state, run, int(places[1]) if "b" in blocks else None)


def prepare_sigma_point(kind: str, setting: Setting) -> Prepared:
    """E4."""
    n = sigma_point.count_states(setting.has_mag)
    options = {
        name: getattr(setting.params, name)
        for name in ("alpha", "beta", "kappa", "weight")
        if hasattr(setting.params, name)
    }
    points, mean, spread = sigma_point.make_points(kind, n, **options)
    rows = setting.noise_rows(sigma_point.GAINS)
    values = setting.constants(sigma_point.CONSTANTS)
    values["c_a"] = setting.decay(values["c_a"])
    constants = np.array([*values.values()])
    state = np.array([sigma_point.start_state(n, q, values["p0"]) for q in setting.q])
    dt = 1.0 / setting.rate_hz

    def run(gyr: Floats, acc: Floats, mag: Floats, state: Floats, out: Floats) -> None:
        sigma_point.run_sigma_point(
            points, mean, spread, gyr, acc, mag, dt, setting.m_ref, rows, constants, state, out
        )

    return Prepared(state, run, 7 if setting.has_mag else None)


def prepare_error_state(kind: str, setting: Setting) -> Prepared:
    """E5."""
    rows = setting.noise_rows(error_state.GAINS)
    values = setting.constants(error_state.CONSTANTS)
    ratio = setting.rate_hz / GAINS_RATE_HZ
    if kind == "disturbed":
        decay = float(getattr(setting.params, "sigma", 0.0))
        values["s_b"] = float(getattr(setting.params, "zeta", 0.0))
        values["xi"] = setting.drive(values["xi"], error_state.ACCELERATION_DECAY)
        values["gamma_d"] = setting.drive(values["gamma"], decay)
        values["sigma_d"] = setting.decay(decay)
    if kind == "external":
        values["m1"] = min(max(round(values["m1"] * ratio), 1), error_state.LONGEST)
        values["m2"] = round(values["m2"] * ratio)
    if kind == "windowed":
        values |= {name: max(values[name] * ratio, 1.0) for name in ("n_s", "n_l", "n_m")}
        values |= {name: values[name] * sqrt(ratio) for name in ("xi_a", "xi_xy")}
        values |= {name: values[name] * ratio for name in ("c_a", "c_m")}
    # only Suh 2010 has variances of its own for the biases
    p_b, p_b_a = (values[n] if kind == "external" else values["p0"] for n in ("p_b", "p_b_a"))
    if not setting.has_mag:
        values["s_b"] = 0.0
    constants = np.array([*values.values()])
    state = np.array(
        [error_state.start_state(kind, q, values["p0"], p_b, p_b_a, setting.has_mag) for q in setting.q]
    )
    number, dt = error_state.KINDS.index(kind), 1.0 / setting.rate_hz
    n, decay_a = error_state.STATES[number], setting.decay(error_state.ACCELERATION_DECAY)

    def run(gyr: Floats, acc: Floats, mag: Floats, state: Floats, out: Floats) -> None:
        error_state.run_error_state(
            number, n, decay_a, gyr, acc, mag, dt, setting.m_ref, rows, constants, state, out
        )

    return Prepared(state, run, 4 if n > 3 else None)


def prepare_direction(kind: str, setting: Setting) -> Prepared:
    """E6."""
    rows = setting.noise_rows(direction.GAINS)
    values = setting.constants(direction.CONSTANTS)
    for decay, drive in (("c_a", "s_a"), ("c_m", "s_m")):
        values[drive] = sqrt(setting.drive(values[drive] ** 2, values[decay]))
        values[decay] = setting.decay(values[decay])
    if kind == "vertical":
        ratio = sqrt(setting.rate_hz / GAINS_RATE_HZ)
        values["sigma_f"] *= ratio
    constants = np.array([*values.values()])
    up = rotate(conjugate(setting.q), np.array([0.0, 0.0, 1.0]))
    field = rotate(conjugate(setting.q), setting.m_ref)
    state = np.array(
        [direction.start_state(kind, *start, constants) for start in zip(setting.q, up, field, strict=True)]
    )
    number, dt = direction.KINDS.index(kind), 1.0 / setting.rate_hz

    def run(gyr: Floats, acc: Floats, mag: Floats, state: Floats, out: Floats) -> None:
        direction.run_direction(number, gyr, acc, mag, dt, setting.m_ref, rows, constants, state, out)

    return Prepared(state, run, direction.BIAS if kind == "vertical" else None)


PREPARE: Final[dict[str, Callable[[str, Setting], Prepared]]] = {
    "E1": prepare_complementary,
    "E2": prepare_quaternion_kalman,
    "E3": prepare_extended_kalman,
    "E4": prepare_sigma_point,
    "E5": prepare_error_state,
    "E6": prepare_direction,
}
