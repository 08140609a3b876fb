"""Cost of the self-calibrating filter relative to VQF, which estimates less, in one run."""

from __future__ import annotations

import sys

import numpy as np
from vqf import VQF, offlineVQF

from sagittal.core.fusion.self_calibrating import SelfCalibratingFilter, smooth_orientations
from tests.helpers.pairs import in_pairs

N, RATE = 60_000, 100.0


def test_a_sample_costs_about_what_vqf_takes() -> None:
    rng = np.random.default_rng(0)
    gyr, acc, mag = (rng.normal(size=(N, 3)) for _ in range(3))
    acc[:, 2] += 9.8
    mag += np.array([0.0, 2.0, -3.0])

    def live() -> None:
        SelfCalibratingFilter(RATE, magnetometer=True).advance(gyr[:, None], acc[:, None], mag[:, None])

    def both_ways() -> None:
        smooth_orientations(gyr[:, None], acc[:, None], RATE, mag[:, None])

    live()
    both_ways()
    _, theirs, forward = in_pairs(live, lambda: VQF(1.0 / RATE).updateBatch(gyr, acc, mag))
    _, _, smoothed = in_pairs(both_ways, lambda: offlineVQF(gyr, acc, mag, 1.0 / RATE))
    sys.stdout.write(
        f"self-calibrating filter: live {forward:.2f}, both ways {smoothed:.2f} of VQF "
        f"({1e6 * theirs / N:.2f} µs a sample)\n"
    )
    assert forward < 2.5
    assert smoothed < 3.0
