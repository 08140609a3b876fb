"""Time of the published filters per sample, against vqf in the same run."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.filter import FusionFilter, RestMeans
from validation.bench.test_mahony import best

N = 20_000
RATE = 100.0


def made(n: int) -> tuple[Floats, Floats, Floats, RestMeans]:
    """Noise about a rest, (n, 1, 3) each."""
    rng = np.random.default_rng(0)
    gyr = np.ascontiguousarray(rng.standard_normal((n, 1, 3)))
    acc = np.ascontiguousarray(np.array([0.0, 0.0, 9.81]) + rng.standard_normal((n, 1, 3)))
    mag = np.ascontiguousarray(np.array([0.0, 20.0, -40.0]) + rng.standard_normal((n, 1, 3)))
    return (
        gyr,
        acc,
        mag,
        RestMeans(np.array([[0.0, 0.0, 9.81]]), np.zeros((1, 3)), np.array([[0.0, 20.0, -40.0]])),
    )


@pytest.mark.parametrize(
    ("names", "limit"),
    [
        (("madgwick_2011", "mahony_2008", "hua_2014", "martin_2010", "wu_2016"), 0.8),
        # 0.51; and two reconstructions with two arc tangents a sample and an eigenvector, 0.61
        (("valenti_2015", "del_rosario_2016", "marantos_2016"), 1.0),
        (("guo_2017", "choukroun_2006"), 5.0),
        # 3.7 to 4.1 by machine
        (("nazarahari_2021",), 6.0),
        (("srckf", "srukf1", "srukf4"), 60.0),
        (("markley_2003", "suh_2019", "roetenberg_2005"), 4.0),
        (("ligorio_2015", "hyyti_2015"), 4.0),
    ],
)
def test_a_sample_takes_at_most_so_many_of_vqf(names: tuple[str, ...], limit: float) -> None:
    vqf = pytest.importorskip("vqf", reason="vqf is a test extra without a wheel for this Python")
    gyr, acc, mag, remainder = made(N)
    for name in names:
        FusionFilter(name, RATE, remainder).advance(gyr[:2], acc[:2], mag[:2])
        ours, theirs = [], []
        # interleaved, so that a busy moment of the machine meets both
        for _ in range(5):
            running = FusionFilter(name, RATE, remainder)
            ours.append(best(lambda r=running: r.advance(gyr, acc, mag), 2))  # type: ignore[misc]
            theirs.append(best(lambda: vqf.VQF(1 / RATE).updateBatch(gyr[:, 0], acc[:, 0], mag[:, 0]), 2))
        ratio = min(ours) / min(theirs)
        print(f"\n{name} {min(ours) / N * 1e6:.2f} µs, vqf {min(theirs) / N * 1e6:.2f}, ratio {ratio:.2f}")
        assert ratio <= limit, name


def test_madgwick_takes_a_three_hundredth_of_ahrs() -> None:
    """The same recursion: ahrs turns one array a sample in Python."""
    ahrs = pytest.importorskip("ahrs")
    gyr, acc, mag, remainder = made(2_000)
    FusionFilter("madgwick_2011", RATE, remainder).advance(gyr[:2], acc[:2], mag[:2])
    ours, theirs = [], []
    for _ in range(3):
        running = FusionFilter("madgwick_2011", RATE, remainder)
        ours.append(best(lambda r=running: r.advance(gyr, acc, mag), 5))  # type: ignore[misc]
        theirs.append(best(lambda: ahrs.filters.Madgwick(gyr[:, 0], acc[:, 0], mag[:, 0], frequency=RATE), 1))
    ratio = min(theirs) / min(ours)
    print(
        f"\nahrs {min(theirs) / len(gyr) * 1e6:.0f} µs, ours {min(ours) / len(gyr) * 1e6:.2f}, {ratio:.0f} ×"
    )
    assert ratio >= 300.0
