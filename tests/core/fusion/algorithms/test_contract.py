"""Contract of every listed algorithm."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from math import inf

import numpy as np
import pytest

from sagittal.core.errors import EstimationError, ParameterError, SignalError
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms import parameters
from sagittal.core.fusion.algorithms.filter import FusionFilter, RestMeans
from sagittal.core.fusion.algorithms.gains import Corners, FixedGain, FuzzyGain, InnovationRules, TwoLevelGain
from sagittal.core.fusion.algorithms.listed import ALGORITHMS, Algorithm
from sagittal.core.rotation import conjugate, exp, multiply, rotate
from tests.core.fusion.algorithms.motion import FIELD, UP, TurningSensors, error_deg, tilt_deg, turning
from tests.data import ROOT

every = pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)

INPUT: Corners = (0.02, 0.08, 0.04, 0.1, 0.15, 0.25, 0.2, 0.4)
FALLING = FuzzyGain((0.005, 0.02, 0.01, 0.03, 0.04, 0.07, 0.05, 0.09), acc=INPUT, mag=INPUT)
RISING = FuzzyGain((0.2, 0.5, 0.4, 0.6, 0.8, 1.2, 1.0, 1.5), acc=INPUT, rising=True)

BIAS = np.radians([0.6, -0.4, 0.5])
"""rad/s."""


def moving() -> TurningSensors:
    return turning(60.0)


def standing(seconds: float, noise: float = 1.0) -> TurningSensors:
    return turning(seconds, speed=0.0, noise=noise)


def start(
    algorithm: Algorithm, take: TurningSensors, params: parameters.AlgorithmGains | None = None
) -> FusionFilter:
    return FusionFilter(algorithm.name, take.rate_hz, take.rest(), params)


def errors(algorithm: Algorithm, q: Floats, truth: Floats) -> Floats:
    """Degrees; of the vertical alone where an algorithm has no magnetometer."""
    return (tilt_deg if algorithm.magnetometer == "unused" else error_deg)(q, truth)


def test_there_are_the_37_of_the_thesis_and_what_is_reconstructed_says_so() -> None:
    assert len(ALGORITHMS) == len({a.name for a in ALGORITHMS}) == 37
    assert {a.engine for a in ALGORITHMS} == {"E1", "E2", "E3", "E4", "E5", "E6"}
    for a in ALGORITHMS:
        assert (a.grade == "C") == ("reconstruction" in a.shown)
        assert a.paper.citation
        assert not a.paper.doi or re.fullmatch(r"10\.\d{4,5}/\S+", a.paper.doi)


def test_the_page_cites_every_paper_with_its_doi_or_says_that_none_was_found() -> None:
    page = (ROOT / "docs/science/filters.md").read_text("utf-8")
    for a in ALGORITHMS:
        result = f"https://doi.org/{a.paper.doi}" if a.paper.doi else f"{a.paper.citation}. No DOI found."
        assert result in page, a.name
        assert a.paper.line.endswith(f"doi:{a.paper.doi}" if a.paper.doi else "No DOI found.")


def test_the_page_names_every_gain_with_its_value() -> None:
    """docs/science/filters.md has one row an algorithm, with the gains the code has."""
    page = (ROOT / "docs/science/filters.md").read_text("utf-8")
    rows = {m[1]: m[2] for m in re.finditer(r"^\| `(\w+)` \|.*\| ([^|]+) \|$", page, re.MULTILINE)}
    assert rows == {a.name: say_gains(a) for a in ALGORITHMS}


def say_gains(algorithm: Algorithm) -> str:
    """Gains and their values as the page has them."""
    gains = algorithm.gains()
    return ", ".join(f"{f.name} {_say(getattr(gains, f.name))}" for f in fields(gains))


def _say(value: object) -> str:
    if isinstance(value, FixedGain):
        return f"{value.value:g}"
    if isinstance(value, TwoLevelGain):
        limits = [f"{n} {x:g}" for n, x in (("A", value.acc), ("M", value.mag), ("G", value.gyr)) if x < inf]
        return f"{value.quiet:g}/{value.moving:g} ({', '.join(limits)})"
    if value is None:
        return "none"
    assert isinstance(value, float)
    return "∞" if value == inf else f"{value:g}"


@pytest.mark.parametrize(
    "algorithm", [a for a in ALGORITHMS if a.magnetometer == "needed"], ids=lambda a: a.name
)
def test_what_needs_a_magnetometer_refuses_without(algorithm: Algorithm) -> None:
    rest_means = RestMeans(np.array([[0.0, 0.0, 9.81]]), np.zeros((1, 3)))
    with pytest.raises(EstimationError) as caught:
        FusionFilter(algorithm.name, 100.0, rest_means)
    assert caught.value.code == "no_magnetometer"


def test_wrong_calls_are_refused() -> None:
    rest_means = RestMeans(np.array([[0.0, 0.0, 9.81]]), np.zeros((1, 3)), np.array([[0.0, 20.0, -40.0]]))
    with pytest.raises(ParameterError, match="No algorithm"):
        FusionFilter("kalman", 100.0, rest_means)
    with pytest.raises(ParameterError, match="takes MahonyGains"):
        FusionFilter("mahony_2008", 100.0, rest_means, parameters.MadgwickGains())
    with pytest.raises(ParameterError, match="rate"):
        FusionFilter("mahony_2008", 0.0, rest_means)
    with pytest.raises(ParameterError, match="share"):
        FusionFilter("justa_2020", 100.0, rest_means, parameters.JustaGains(sigma_a=FixedGain(1.5)))
    ready = FusionFilter("mahony_2008", 100.0, rest_means)
    with pytest.raises(EstimationError, match="magnetometer"):
        ready.advance(np.zeros((1, 1, 3)), np.zeros((1, 1, 3)))
    with pytest.raises(ParameterError, match="shape"):
        ready.advance(np.zeros((2, 1, 3)), np.zeros((1, 1, 3)), np.zeros((2, 1, 3)))
    with pytest.raises(SignalError):
        RestMeans(np.zeros((1, 3)), np.zeros((1, 3))).find_start()
    with pytest.raises(SignalError):
        RestMeans.over(np.full((2, 1, 3), np.nan), np.zeros((2, 1, 3)))


def test_a_start_is_upright_and_faces_north_however_the_sensor_sits() -> None:
    take = turning(0.1, sensors=6, noise=0.0)
    q, field = take.rest().find_start()
    assert error_deg(q, take.q[0]).max() < 1e-6
    assert np.abs(field - FIELD / np.linalg.norm(FIELD)).max() < 1e-12
    upright = np.array([[9.81, 0.0, 0.0], [0.0, 9.81, 0.0], [0.0, 0.0, 9.81]])
    q, _ = RestMeans(upright, np.zeros((3, 3))).find_start()
    assert np.abs(rotate(conjugate(q), UP) - upright / 9.81).max() < 1e-12


@pytest.mark.sweep
@every
def test_standing_for_30_s_it_stays(algorithm: Algorithm) -> None:
    take = standing(30.0)
    q = start(algorithm, take).advance(take.gyr, take.acc, take.mag)
    assert np.isfinite(q).all()
    assert np.abs(np.linalg.norm(q, axis=-1) - 1.0).max() < 1e-9
    assert errors(algorithm, q, take.q).max() < 2.0


@pytest.mark.sweep
@every
def test_from_28_degrees_off_it_comes_back(algorithm: Algorithm) -> None:
    """The slow ones correct a tenth of a tilt a second, and less of a heading."""
    take = standing(400.0)
    running = start(algorithm, take)
    off = multiply(take.q[0], exp(np.radians([15.0, -12.0, 20.0])))
    running.reset(off)
    q = running.advance(take.gyr, take.acc, take.mag)
    assert errors(algorithm, q[0], take.q[0]).max() > 15.0
    assert errors(algorithm, q[-1], take.q[-1]).max() < 2.0


@pytest.mark.sweep
@every
def test_it_follows_the_truth_while_turning(algorithm: Algorithm) -> None:
    take = moving()
    q = start(algorithm, take).advance(take.gyr, take.acc, take.mag)
    assert np.sqrt(np.mean(errors(algorithm, q, take.q) ** 2)) < 2.0


@pytest.mark.sweep
@every
def test_half_a_second_of_no_numbers_is_survived(algorithm: Algorithm) -> None:
    take = moving()
    gyr, acc, mag = take.gyr.copy(), take.acc.copy(), take.mag.copy()
    still = slice(1000, 1050)
    for x in (gyr, acc, mag):
        x[still] = np.nan
    q = start(algorithm, take).advance(gyr, acc, mag)
    assert np.isfinite(q).all()
    # held, but for a bias of its own that a filter goes on taking off
    assert error_deg(q[1049], q[999]).max() < 0.2
    whole = errors(algorithm, start(algorithm, take).advance(take.gyr, take.acc, take.mag), take.q)[
        -500:
    ].mean()
    initial_average = errors(algorithm, q[1050], take.q[1050]).mean()
    assert errors(algorithm, q, take.q)[-500:].mean() < whole + 0.6 * initial_average


@pytest.mark.sweep
@every
def test_blocks_of_any_length_and_sensors_alone_give_the_same_bits(algorithm: Algorithm) -> None:
    take = moving()
    n = 700
    whole = start(algorithm, take).advance(take.gyr[:n], take.acc[:n], take.mag[:n])
    second = start(algorithm, take).advance(take.gyr[:n], take.acc[:n], take.mag[:n])
    assert np.array_equal(whole, second)
    running, parts, position = start(algorithm, take), [], 0
    for length in (1, 2, 0, 97, 300, 300):
        part = slice(position, position + length)
        parts.append(running.advance(take.gyr[part], take.acc[part], take.mag[part]))
        position += length
    assert np.array_equal(np.concatenate(parts), whole)
    remainder = take.rest()
    assert remainder.mag is not None
    single = FusionFilter(
        algorithm.name, take.rate_hz, RestMeans(remainder.acc[1:], remainder.gyr[1:], remainder.mag[1:])
    )
    steps = [single.step(take.gyr[k, 1:], take.acc[k, 1:], take.mag[k, 1:]) for k in range(50)]
    assert np.array_equal(np.array(steps), whole[:50, 1:])


@pytest.mark.sweep
@pytest.mark.parametrize(
    "algorithm", [a for a in ALGORITHMS if a.magnetometer != "needed"], ids=lambda a: a.name
)
def test_without_a_magnetometer_it_keeps_the_vertical_and_learns_no_bias(algorithm: Algorithm) -> None:
    take = moving()
    remainder = take.rest()
    running = FusionFilter(algorithm.name, take.rate_hz, RestMeans(remainder.acc, remainder.gyr))
    q = running.advance(take.gyr, take.acc)
    assert np.sqrt(np.mean(tilt_deg(q, take.q) ** 2)) < 2.0
    if algorithm.name in ("hyyti_2015", "valenti_2015"):
        return
    bias = running.bias
    assert bias is None or np.abs(bias).max() == 0.0


@pytest.mark.sweep
@pytest.mark.parametrize(
    ("name", "params"),
    [
        ("nazarahari_2021", None),
        ("gyrolib_2020", None),
        ("chen_2017", None),
        ("markley_2003", None),
        ("roetenberg_2005", None),
        ("srckf", None),
        ("srukf3", None),
        ("mahony_2008", parameters.MahonyGains(kp=FixedGain(1.0), ki=0.1)),
        ("madgwick_2011", parameters.MadgwickGains(beta=FixedGain(0.1), zeta=0.005)),
        ("hua_2014", parameters.HuaGains(k1=1.0, k2=1.0, k3=0.1, k4=0.1)),
    ],
)
def test_a_bias_of_the_gyroscope_is_found(name: str, params: parameters.AlgorithmGains | None) -> None:
    take = turning(180.0)
    running = FusionFilter(name, take.rate_hz, take.rest(), params)
    q = running.advance(take.gyr + BIAS, take.acc, take.mag)
    assert running.bias is not None
    assert np.degrees(np.abs(running.bias - BIAS)).max() < 0.1
    assert error_deg(q[-1], take.q[-1]).max() < 1.0


@pytest.mark.sweep
def test_the_bias_of_the_proposed_linear_filter_is_inert() -> None:
    take = moving()
    running = FusionFilter("nazarahari_2020", take.rate_hz, take.rest())
    running.advance(take.gyr + BIAS, take.acc, take.mag)
    assert running.bias is None


@pytest.mark.sweep
def test_points_of_every_set_agree_with_the_extended_filter() -> None:
    """From a known start: a wide one is where the two differ, by half a degree of one."""
    take = turning(30.0)
    known = 1e-5
    base = FusionFilter("chen_2017", take.rate_hz, take.rest(), parameters.ChenGains(p0=known)).advance(
        take.gyr, take.acc, take.mag
    )
    sets: dict[str, parameters.AlgorithmGains] = {
        "srckf": parameters.CubatureGains(p0=known),
        "srukf1": parameters.MerweGains(p0=known),
        "srukf2": parameters.JulierGains(p0=known),
        "srukf3": parameters.SimplexGains(p0=known),
        "srukf4": parameters.MenegazGains(p0=known),
    }
    for name, gains in sets.items():
        q = FusionFilter(name, take.rate_hz, take.rest(), gains).advance(take.gyr, take.acc, take.mag)
        assert error_deg(q, base).max() < (0.05 if name in ("srckf", "srukf1", "srukf2") else 0.2), name


@pytest.mark.sweep
@pytest.mark.parametrize(
    ("name", "params"),
    [
        ("madgwick_2011", parameters.MadgwickGains(FALLING)),
        ("guo_2017", parameters.GuoGains(sigma_a=RISING)),
        ("nazarahari_2021", parameters.Nazarahari2021Gains(sigma_a=RISING)),
    ],
)
def test_fuzzy_gains_run_in_any_engine_and_blocks(name: str, params: parameters.AlgorithmGains) -> None:
    take = moving()
    whole = FusionFilter(name, take.rate_hz, take.rest(), params).advance(take.gyr, take.acc, take.mag)
    assert np.sqrt(np.mean(error_deg(whole, take.q) ** 2)) < 2.0
    parts = FusionFilter(name, take.rate_hz, take.rest(), params)
    advances = [
        parts.advance(take.gyr[k : k + 1000], take.acc[k : k + 1000], take.mag[k : k + 1000])
        for k in range(0, len(take.gyr), 1000)
    ]
    assert np.array_equal(np.concatenate(advances), whole)


@pytest.mark.sweep
def test_the_process_noise_of_guo_follows_the_innovations() -> None:
    """Started too small it grows, started too large it falls: towards a noisy gyroscope's 0.5 rad/s."""
    take = moving()
    gyr = take.gyr + 0.5 * np.random.default_rng(5).standard_normal(take.gyr.shape)
    wide, step = 3e-5, 1e-3
    shape = np.array([-1.0, -0.1, -0.2, -0.05, 0.05, 0.2, 0.1, 1.0])
    l1, l2, m1, m2, m3, m4, h1, h2 = shape.tolist()
    corners: Corners = (l1, l2, m1, m2, m3, m4, h1, h2)

    def scaled(key: float) -> Corners:
        a, b, c, d, e, f, g, h = (key * x for x in corners)
        return a, b, c, d, e, f, g, h

    for sigma in (0.01, 1.5):
        gains = parameters.GuoGains(
            sigma_g=FixedGain(sigma),
            sigma_a=FixedGain(0.003),
            sigma_m=FixedGain(0.004),
            adaptation=InnovationRules(scaled(wide), scaled(step)),
        )
        running = FusionFilter("guo_2017", take.rate_hz, take.rest(), gains)
        q = running.advance(gyr, take.acc, take.mag)
        assert np.sqrt(np.mean(error_deg(q, take.q) ** 2)) < 2.0
        end = np.sqrt(running._prepared.state[:, 20:23])
        # innovations and axes do not correspond, so single axes scatter
        assert 0.15 < np.median(end) < 1.3
        assert (end > sigma).all() if sigma < 0.5 else (end < sigma).all()
        split = FusionFilter("guo_2017", take.rate_hz, take.rest(), gains)
        parts = [
            split.advance(gyr[k : k + 500], take.acc[k : k + 500], take.mag[k : k + 500])
            for k in range(0, len(take.gyr), 500)
        ]
        assert np.array_equal(np.concatenate(parts), q)


@pytest.mark.sweep
def test_no_bound_is_the_extended_filter_and_a_small_one_diverges() -> None:
    take = moving()
    free = parameters.Nazarahari2021Gains()
    name = "nazarahari_2021"
    base = FusionFilter(name, take.rate_hz, take.rest(), free).advance(take.gyr, take.acc, take.mag)
    wide = FusionFilter(name, take.rate_hz, take.rest(), replace(free, gamma=1e6))
    assert np.abs(wide.advance(take.gyr, take.acc, take.mag) - base).max() < 1e-9
    narrow = FusionFilter(name, take.rate_hz, take.rest(), replace(free, gamma=0.01))
    with pytest.raises(EstimationError) as caught:
        narrow.advance(take.gyr, take.acc, take.mag)
    assert caught.value.code == "filter_diverged"


@pytest.mark.sweep
def test_to_first_order_four_complementary_filters_are_one() -> None:
    """Equal gains: Mahony, Justa, Wu 2019 and Marantos."""
    take = turning(30.0)
    share, one = 0.002, FixedGain(0.002)
    runs: dict[str, parameters.AlgorithmGains] = {
        "mahony_2008": parameters.MahonyGains(kp=FixedGain(0.2)),
        "justa_2020": parameters.JustaGains(sigma_a=one, sigma_m=one),
        "wu_2019": parameters.Wu2019Gains(w_a=0.5, w_m=0.5, x=2.0 * share),
        "marantos_2016": parameters.MarantosGains(w_a=FixedGain(2.0 * share), w_m=FixedGain(2.0 * share)),
    }
    advances = [
        FusionFilter(name, take.rate_hz, take.rest(), gains).advance(take.gyr, take.acc, take.mag)
        for name, gains in runs.items()
    ]
    assert max(error_deg(q, advances[0]).max() for q in advances[1:]) < 0.05
