"""The constrained estimators on neura_walk, from the sensors alone, scored as test_neura_walk.py does.

Nothing was fitted here; the presets are those of docs/science/erkf.md, "Parameters", which were found on this
recording.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sagittal.core.body import BodyModel
from sagittal.core.body.erkf.poses import run_erkf
from sagittal.core.body.l7s.filter import Worn
from sagittal.core.body.l7s.inputs import free_acceleration
from sagittal.core.body.l7s.poses import l7s_poses
from sagittal.core.body.still import FOOT_STILL, still_samples
from sagittal.core.frames import FOOT, SIDES, Bools, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from tests.helpers.neura import BODY, HEIGHT_M, SHIPPED, angles_deg, healthy, stride_errors_m, take
from tests.helpers.neura_angles import scores
from tests.helpers.walks import neura_analysis
from validation.figures import record, record_in_short

FLEXION = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")

# docs/science/real-recordings.md, "Limits", right and left: offset removed (the ambitious ones for flexion),
# standing zeroed, r
OFFSET_REMOVED = {
    "hip_flexion": (2.3, 3.3), "knee_flexion": (2.8, 4.5), "ankle_dorsiflexion": (2.2, 2.5),
    "hip_adduction": (4.5, 3.6), "knee_adduction": (2.4, 4.4), "ankle_inversion": (5.3, 5.2),
    "hip_rotation": (5.0, None),
}  # fmt: skip
ZEROED = {"hip_flexion": (3.2, 3.8), "knee_flexion": (4.0, 6.3), "ankle_dorsiflexion": (3.0, 2.9)}
CORRELATION = {
    "hip_flexion": (0.985, 0.983), "knee_flexion": (0.988, 0.976), "ankle_dorsiflexion": (0.97, 0.95),
    "hip_adduction": (0.6, 0.8), "hip_rotation": (0.7, None),
}  # fmt: skip
NO_LIMIT = ("knee_rotation", "ankle_rotation")
# the same section, mean of the sides: RMSE and r
L7S_LIMIT = {"3I": ((6.0, 9.0, 7.0), (0.92, 0.88, 0.78)), "2I": ((6.9, 10.0, 7.5), (0.88, 0.80, 0.74))}


def raw_degrees(q: dict[Segment, Floats]) -> dict[str, Floats]:
    """Raw (not zeroed) angles by name in degrees of segment orientations (n, 4)."""
    calibrated, orientations = take()
    n = len(orientations.t_s)
    posed = Orientations(orientations.t_s, 100.0, q, {s: np.ones(n, bool) for s in q}, "")
    return angles_deg(posed, calibrated)


def lone_strides_cm(side: Side) -> Floats:
    """Errors of one foot's straight strides from its own sensor alone."""
    run = run_erkf(*take(), BODY, (FOOT[side],), SHIPPED)
    return 100 * stride_errors_m(side, run.tree.segment_origin(run.track.p, run.track.q)[:, 0])


def test_the_erkf_with_smoother_is_within_the_limits() -> None:
    output = healthy()
    lag, result = scores(output.angles_deg)
    strides = output.strides_cm()
    residual = output.residual_mm()
    rows = []
    for name in (*OFFSET_REMOVED, *NO_LIMIT):
        pair = [result[f"{name}_{end}"] for end in "rl"]
        cells = [name.replace("_", " "), "/".join(f"{x.offset_removed:.1f}" for x in pair)]
        cells.append(_limits(OFFSET_REMOVED, name, ".1f"))
        cells += ["/".join(f"{x.zeroed:.1f}" for x in pair), _limits(ZEROED, name, ".1f")]
        cells += ["/".join(f"{x.r:.3f}" for x in pair), _limits(CORRELATION, name, ".3f")]
        rows.append(cells)
    record(
        "ErKF and smoother on neura_walk",
        ["angle, right/left", "RMSE offset removed °", "limit", "standing zeroed °", "limit", "r", "limit"],
        rows,
        f"Seven sensors, places from motion, height {HEIGHT_M} m, lag {lag * 10} ms; one person, one walk "
        "out and back. Rotations of knee and ankle rest on single markers: low confidence, no limit. "
        f"Straight strides against Vicon: {_told(strides)}; limit 2.5 ± 1.5 cm. From each foot's sensor "
        f"alone: {_told({s: lone_strides_cm(s) for s in SIDES})}; limit 2 ± 1 cm. Joint-centre residual "
        f"{residual.min():.0f} to {residual.max():.0f} mm, {int(output.run.track.refused.sum())} zero "
        "velocities refused. The noise figures were found on this recording (docs/science/erkf.md).",
    )
    means = [np.mean([result[f"{name}_{end}"].offset_removed for end in "rl"]) for name in FLEXION]
    record_in_short(
        "Flexion of hip / knee / ankle, seven sensors: RMSE °",
        "below 5 is called acceptable (McGinley 2009)",
        " / ".join(f"{x:.1f}" for x in means),
        "neura_walk, 1 person, offset removed, mean of both sides; noise figures were found on it",
    )
    for limits, value in ((OFFSET_REMOVED, "offset_removed"), (ZEROED, "zeroed")):
        for name, pair_of_limits in limits.items():
            for end, limit in zip("rl", pair_of_limits, strict=True):
                assert limit is None or getattr(result[f"{name}_{end}"], value) <= limit, f"{name} {end}"
    for name, least in CORRELATION.items():
        for end, r in zip("rl", least, strict=True):
            assert r is None or result[f"{name}_{end}"].r >= r, f"{name} {end}"
    for errors in strides.values():
        assert len(errors) == 5
        assert abs(errors.mean()) <= 2.5
        assert errors.std() <= 1.5
    assert residual.max() <= 30.0


def test_strides_of_a_foot_alone_are_within_the_limits() -> None:
    for side in SIDES:
        errors = lone_strides_cm(side)
        assert abs(errors.mean()) <= 2.0
        assert errors.std() <= 1.0


def test_the_pipeline_gives_these_angles_and_feet() -> None:
    result, analysis = healthy(), neura_analysis()
    assert analysis.problem is None
    assert analysis.poses is not None
    assert analysis.orientations is not None
    assert analysis.feet is not None
    assert (analysis.poses.method, analysis.poses.reduced) == ("erkf_smoothed", None)
    for segment, q in result.orientations.q.items():
        np.testing.assert_allclose(analysis.orientations.q[segment], q, atol=1e-12)
    for side in SIDES:
        np.testing.assert_allclose(analysis.feet.p[side], result.ankle(side), atol=1e-9)


def _limits(table: Mapping[str, tuple[float, float | None]], name: str, form: str) -> str:
    return "/".join("–" if x is None else format(x, form) for x in table.get(name, ())) or "none"


def _told(strides: dict[Side, Floats]) -> str:
    return ", ".join(f"{s} {e.mean():+.1f} ± {e.std():.1f} cm (n={len(e)})" for s, e in strides.items())


def test_l7s_from_three_and_two_sensors_is_within_the_limits() -> None:
    calibrated, orientations = take()
    steps: dict[Side, Bools] = {}
    for side in SIDES:
        signals = calibrated.recording.sensors[FOOT[side]]
        gyr = signals.gyr - calibrated.calibration.segments[FOOT[side]].gyro_bias
        steps[side] = still_samples(signals.acc, gyr, signals.valid, 100.0, FOOT_STILL)
    acceleration = free_acceleration(calibrated, orientations)
    rows: list[list[str]] = []
    retained: dict[str, list[tuple[float, float]]] = {}
    segments: Worn
    for segments in ("3I", "2I"):
        poses = l7s_poses(
            orientations, acceleration, steps, BodyModel.from_height(HEIGHT_M), configuration=segments
        )
        _, result = scores(raw_degrees(dict(poses.q)))
        figures = [
            (
                float(np.mean([result[f"{n}_{e}"].offset_removed for e in "rl"])),
                float(np.mean([result[f"{n}_{e}"].r for e in "rl"])),
            )
            for n in FLEXION
        ]
        retained[segments] = figures
        rows.append([f"L7S-{segments}", *(f"{rmse:.1f} / {r:.2f}" for rmse, r in figures)])
    rows.append(["Sy 2021 Table V, 3I", "5.0 / .95", "8.2 / .91", "5.9 / .78"])
    rows.append(["Sy 2021 Table V, 2I", "6.9 / .90", "9.5 / .89", "7.5 / .77"])
    record(
        "L7S on neura_walk",
        ["run", "hip flexion RMSE ° / r", "knee", "ankle"],
        rows,
        "Mean of both sides, offset removed, whole walk with its turn; the paper's figures are of nine "
        "people, per step of straight walking. Both ways (the file); live has the filter's figures of the "
        'table "L7S: both ways".',
    )
    for segments, number, paper in (("3I", "three", "5.0 / 8.2 / 5.9"), ("2I", "two", "6.9 / 9.5 / 7.5")):
        record_in_short(
            f"The same with {number} sensors (L7S)",
            f"{paper} (Sy 2021 Table V, 9 people)",
            " / ".join(f"{rmse:.1f}" for rmse, _ in retained[segments]),
            "neura_walk, 1 person, whole walk with its turn",
        )
    for mode, (rmse_limits, r_limits) in L7S_LIMIT.items():
        for (rmse, r), rmse_limit, r_limit in zip(retained[mode], rmse_limits, r_limits, strict=True):
            assert rmse <= rmse_limit, mode
            assert r >= r_limit, mode
