"""Self-calibrating filter on eight trials of BROAD, live and smoothed, compared with vqf."""

from __future__ import annotations

from dataclasses import astuple
from functools import cache

import numpy as np
import pytest

from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.benchmark import ReferenceTrial, read_trial, run_own, score_orientation
from sagittal.core.fusion.self_calibrating import SelfCalibratingFilter
from sagittal.core.rotation import conjugate, log, multiply
from tests.data import data_folder
from validation.figures import record

LIMITS_DEG = {"live": (1.20, 0.55), "both ways": (0.91, 0.49)}
"""Mean total and inclination error over the trials."""


@cache
def trials() -> tuple[ReferenceTrial, ...]:
    return tuple(read_trial(p.stem, p.read_bytes()) for p in sorted(data_folder("broad").glob("*.npz")))


def errors_deg(q: Floats, trial: ReferenceTrial) -> Floats:
    """Total, heading and inclination."""
    return np.degrees(astuple(score_orientation(q, trial)))


@cache
def ours(way: str) -> Floats:
    return np.array([errors_deg(run_own(t, both_ways=way == "both ways"), t) for t in trials()])


@pytest.mark.parametrize("way", LIMITS_DEG)
def test_the_mean_errors_are_within_their_limits(way: str) -> None:
    total, _, inclination = ours(way).mean(axis=0)
    assert total <= LIMITS_DEG[way][0]
    assert inclination <= LIMITS_DEG[way][1]


def test_the_stated_covariance_holds_the_errors_of_real_sensors() -> None:
    """Tilt and heading are within the stated 95 % for nine of ten moments of every trial."""
    for t in trials():
        run, step = SelfCalibratingFilter(t.rate_hz, magnetometer=True), round(t.rate_hz / 2)
        tilt, heading = [], []
        for k in range(0, len(t.gyr) - step, step):
            part = slice(k, k + step)
            q = run.advance(t.gyr[part, None], t.acc[part, None], t.mag[part, None])[-1, 0]
            index = k + step - 1
            if not t.moving[index] or not np.isfinite(t.reference[index]).all():
                continue
            e, P = log(multiply(t.reference[index], conjugate(q))), run.estimates.orientation_covariance[0]
            tilt.append(float(e[:2] @ np.linalg.solve(P[:2, :2], e[:2])) < 5.99)
            heading.append(e[2] ** 2 / P[2, 2] < 3.84)
        assert np.mean(tilt) >= 0.89, t.name
        assert np.mean(heading) >= 0.95, t.name


def test_no_look_at_the_field_tilts() -> None:
    """Inclination with and without the magnetometer is the same to a tenth of a degree, in the mean."""
    without = []
    for t in trials():
        run = SelfCalibratingFilter(t.rate_hz, magnetometer=False)
        without.append(errors_deg(run.advance(t.gyr[:, None], t.acc[:, None])[:, 0], t)[2])
    assert np.mean(without) == pytest.approx(ours("live")[:, 2].mean(), abs=0.1)


def test_what_the_device_taught_elsewhere_helps_live() -> None:
    """Every trial begins with the median of the gyroscope matrices that the others of the device found."""
    matrices = []
    for t in trials():
        run = SelfCalibratingFilter(t.rate_hz, magnetometer=True)
        run.smooth(t.gyr[:, None], t.acc[:, None], t.mag[:, None])
        matrices.append(run.estimates.gyro_matrix)
    taught = []
    for k, t in enumerate(trials()):
        remaining = np.median([m for j, m in enumerate(matrices) if j != k], axis=0)
        run = SelfCalibratingFilter(t.rate_hz, magnetometer=True, gyro_matrix=remaining)
        taught.append(errors_deg(run.advance(t.gyr[:, None], t.acc[:, None], t.mag[:, None])[:, 0], t))
    rows = [
        [t.name, _words(single), _words(led)]
        for t, single, led in zip(trials(), ours("live"), taught, strict=True)
    ]
    rows.append(["mean", _words(ours("live").mean(axis=0)), _words(np.mean(taught, axis=0))])
    record(
        "Gyroscope matrix carried from recording to recording",
        ["trial", "alone", "with the others' matrix"],
        rows,
        "Self-calibrating filter, live; RMS in degrees, total / heading / inclination. All trials are of one "
        "make of sensor; the matrix of a trial's own is left out.",
    )
    assert np.mean(taught, axis=0)[0] <= ours("live").mean(axis=0)[0]


def test_write_down_the_figures() -> None:
    vqf = pytest.importorskip("vqf", reason="vqf is a test extra without a wheel for this Python")
    theirs = {
        "live": [vqf.VQF(1.0 / t.rate_hz).updateBatch(t.gyr, t.acc, t.mag)["quat9D"] for t in trials()],
        "both ways": [vqf.offlineVQF(t.gyr, t.acc, t.mag, 1.0 / t.rate_hz)["quat9D"] for t in trials()],
    }
    columns = []
    for way in LIMITS_DEG:
        columns += [
            np.array([errors_deg(q, t) for q, t in zip(theirs[way], trials(), strict=True)]),
            ours(way),
        ]
    rows = [[t.name, *(_words(c[k]) for c in columns)] for k, t in enumerate(trials())]
    rows.append(["mean", *(_words(c.mean(axis=0)) for c in columns)])
    record(
        "Self-calibrating filter on BROAD",
        ["trial", "vqf, live", "ours, live", "vqf, both ways", "ours, both ways"],
        rows,
        "RMS in degrees, total / heading / inclination, moving phase; each finds its start. Limits of "
        "the mean total and inclination: live 1.20 / 0.55, both ways 0.91 / 0.49. Parameters were chosen on "
        "these trials. Every trial ends where it began, which both ways knows again. Heading and total of "
        "fast translation both ways are not as good as vqf's (docs/science/self-calibrating-filter.md).",
    )
    assert ours("live").mean(axis=0)[0] < columns[0].mean(axis=0)[0]
    result = {t.name[:2]: [c[k] for c in columns] for k, t in enumerate(trials())}
    assert result["16"][1][2] < result["16"][0][2] + 0.02  # fast translation, inclination live
    assert result["16"][1][0] < result["16"][0][0] + 0.02  # and total
    assert result["24"][3][1] < result["24"][2][1]  # tapping, heading both ways


def _words(errors: Floats) -> str:
    return " / ".join(f"{x:.2f}" for x in errors)
