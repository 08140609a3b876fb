"""Potter et al. 2021, Tables 2 and 3, reproduced on their own walker: three bodies, 512 Hz, white noise."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import radians

import numpy as np

from sagittal.core.body.erkf.filter import ErkfInputs, filter_block
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.tree import walker3
from sagittal.core.frames import SIDES, Floats
from sagittal.core.rotation import conjugate, multiply, to_matrix
from sagittal.core.simulate.potter import LEG, PotterWalk, potter_walk
from validation.figures import record, record_in_short

STRIDES = 200


@cache
def walk() -> PotterWalk:
    return potter_walk(STRIDES)


def run(params: ErkfParams, seed: int = 0) -> tuple[Floats, dict[str, Floats]]:
    """Sensor positions (n, 3, 3) and hip angles (n,) in degrees by axis and side."""
    truth, tree = walk(), walker3()
    acc, gyr = truth.add_noise(seed=seed)
    n = len(truth.t_s)
    step = np.full(n, 1.0 / truth.rate_hz)
    step[0] = 0.0
    still = np.repeat(truth.still[:, None], 3, axis=1)
    contact = still.copy()
    contact[:, 0] = False
    inputs = ErkfInputs(step, acc, gyr, np.ones((n, 3), bool), contact, still)
    lead = round(2.0 * truth.rate_hz)
    first = start_state(tree, inputs, params, (0, lead), q=truth.q[0])
    track, _ = filter_block(first, inputs, tree, params)
    angles = {}
    for side in SIDES:
        relative = to_matrix(multiply(conjugate(track.q[:, 0]), track.q[:, LEG[side]]))
        angles[f"FE {side}"] = np.degrees(np.arctan2(-relative[:, 0, 1], relative[:, 1, 1]))
        angles[f"AA {side}"] = np.degrees(np.arcsin(np.clip(relative[:, 2, 1], -1.0, 1.0)))
        angles[f"IE {side}"] = np.degrees(np.arctan2(-relative[:, 2, 0], relative[:, 2, 2]))
    return track.p, angles


def errors(angles: dict[str, Floats]) -> dict[str, tuple[float, float]]:
    """Axis → RMS error in degrees, the larger of both sides, and their mean slope in degrees per hour."""
    truth = walk()
    out = {}
    for axis in ("FE", "IE", "AA"):
        result = []
        for side in SIDES:
            true = np.degrees(truth.hip_flexion[side]) if axis == "FE" else 0.0
            e = angles[f"{axis} {side}"] - true
            slope = float(np.polyfit(truth.t_s / 3600.0, e, 1)[0])
            result.append((float(np.sqrt(np.mean(e**2))), slope))
        out[axis] = max(rms for rms, _ in result), float(np.mean([s for _, s in result]))
    return out


def test_tables_2_and_3_are_reproduced() -> None:
    p, angles = run(ErkfParams.paper())
    result = errors(angles)
    # one walk of 7 minutes leaves ±0.1 °/h of chance in a slope: the mean of three is held to the limit
    second_errors = [errors(run(ErkfParams.paper(), seed)[1]) for seed in (1, 2)]
    slopes = {a: float(np.mean([e[a][1] for e in (result, *second_errors)])) for a in result}
    lengths, widths = walk().strides(p)
    true_lengths, true_widths = walk().strides()
    length, width = (lengths - true_lengths) * 1e3, (widths - true_widths) * 1e3
    raw = errors(run(replace(ErkfParams.paper(), joint_centre_sd=None, joint_axis_sd=None, tilt_sd=None))[1])
    misprint = errors(run(replace(ErkfParams.paper(), joint_axis_sd=radians(1.15) * 57.3))[1])
    rows = [["paper, Table 2", "0.17", "0.09", "0.08", "< 0.1"]]
    for name, e in (
        ("ours", result),
        ("σ_JA 1.15 rad as printed", misprint),
        ("no joint and tilt corrections", raw),
    ):
        slope = max((e[a][1] for a in e), key=abs)
        rows.append([name, *(f"{e[a][0]:.3f}" for a in ("FE", "IE", "AA")), f"{slope:+.3f}"])
    record(
        "Potter's walker with the ErKF",
        ["run", "hip FE RMS °", "IE °", "AA °", "slope °/h"],
        rows,
        f"{STRIDES} strides at 512 Hz; mean slope of FE over three noise seeds {slopes['FE']:+.3f} °/h. "
        f"Stride length error {length.mean():+.1f} ± {length.std():.1f} mm "
        f"(paper 10 ± 10), width {width.mean():+.1f} ± {width.std():.1f} mm (paper 0 ± 10). The unit of σ_JA "
        "in the paper's Table 1 is a misprint: with 1.15 rad rotation and adduction miss its Table 2.",
    )
    record_in_short(
        "Hip flexion / rotation / adduction of Potter's walker: RMS °",
        "0.17 / 0.09 / 0.08 (Potter's Table 2)",
        " / ".join(f"{result[a][0]:.2f}" for a in ("FE", "IE", "AA")),
        f"simulation of the paper, {STRIDES} strides",
    )
    for axis, limit in (("FE", 0.20), ("IE", 0.11), ("AA", 0.10)):
        assert result[axis][0] <= limit, axis
        assert abs(slopes[axis]) < 0.15, axis
    assert np.sqrt(np.mean(length**2)) <= 10.0
    assert np.sqrt(np.mean(width**2)) <= 20.0
    assert misprint["IE"][0] > 0.2
    assert raw["FE"][0] > 1.0
