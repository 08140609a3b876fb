"""Everything that follows the events: measured by the pipeline and measured again after an edit alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.body.walking_frame import in_walking_frame
from sagittal.core.events.edits import Edit
from sagittal.core.frames import R_NEUTRAL
from sagittal.core.parameters.measure import MeasuredGait, measure_gait
from sagittal.core.parameters.result import Parameter
from sagittal.core.pipeline import TakeAnalysis
from sagittal.core.rotation import about, from_matrix, multiply, rotate
from sagittal.server.report.files.bundle import load_bundle
from sagittal.server.report.files.exports import analysis_files
from sagittal.server.report.files.tracks import NAME, read_tracks
from tests.helpers.walks import analysed, assert_same_figures
from tests.server import walk


@pytest.fixture(scope="module")
def analysis() -> TakeAnalysis:
    return analysed("comfortable", 1)


def figure(measured: MeasuredGait, name: str, side: str | None = "left") -> Parameter:
    return next(p for p in measured.parameters if (p.name, p.side) == (name, side))


@pytest.mark.slow
def test_the_pipeline_gives_what_measure_gives_on_its_tracks(analysis: TakeAnalysis) -> None:
    assert analysis.tracks is not None
    again = measure_gait(analysis.tracks)
    assert_same_figures(again.parameters, analysis.parameters)
    assert analysis.strides is not None
    assert_same_figures(again.strides.strides, analysis.strides.strides)


@pytest.mark.slow
def test_stored_and_read_again_it_gives_the_same_numbers(analysis: TakeAnalysis) -> None:
    files = analysis_files(analysis)
    bundle = load_bundle(files)
    again = measure_gait(read_tracks(files[NAME], bundle.events, bundle.angles))
    for read, written in zip(again.parameters, analysis.parameters, strict=True):
        assert (read.name, read.side, read.n, read.reason) == (
            written.name,
            written.side,
            written.n,
            written.reason,
        )
        if written.mean is not None:
            # 0.1 ms, 0.1 mm, 0.001°: float32 and six decimals
            assert read.mean == pytest.approx(written.mean, rel=1e-4, abs=1e-3), read.name
    assert analysis.strides is not None
    for a, b in zip(again.strides.strides, analysis.strides.strides, strict=True):
        assert (a.side, a.flags, a.excluded_reason) == (b.side, b.flags, b.excluded_reason)


def test_moving_a_foot_off_changes_stance_and_swing_of_its_stride_alone() -> None:
    tracks = walk.tracks()
    before = measure_gait(tracks)
    i, stride = next((i, s) for i, s in enumerate(before.strides.strides) if s.excluded_reason is None)
    assert stride.tc_s is not None
    after = measure_gait(tracks, [Edit("move_event", stride.side, stride.tc_s, "tc", stride.tc_s + 0.03)])
    for name, change in (("stance_time_s", 0.03), ("swing_time_s", -0.03), ("stride_time_s", 0.0)):
        old, new = before.columns[name], after.columns[name]
        assert new[i] == pytest.approx(old[i] + change, abs=1e-9)  # type: ignore[operator]
        assert [n for k, n in enumerate(new) if k != i] == [o for k, o in enumerate(old) if k != i]


def test_a_deleted_contact_merges_two_strides_and_a_rule_sets_the_long_one_aside() -> None:
    tracks = walk.tracks(20.0)
    before = measure_gait(tracks)
    contact = tracks.events.times("right", "ic")[6]
    after = measure_gait(tracks, [Edit("delete_event", "right", contact, "ic")])
    assert len(after.strides.strides) == len(before.strides.strides) - 1
    merged = next(s for s in after.strides.strides if s.side == "right" and s.start_s < contact < s.end_s)
    assert merged.excluded_by == "rule"
    assert figure(after, "stride_time_s", "right").mean == pytest.approx(walk.STRIDE_S)


def test_a_person_leaves_a_stride_out_and_every_figure_counts_one_less() -> None:
    tracks = walk.tracks()
    before = measure_gait(tracks)
    stride = before.strides.select_used("left")[2]
    middle = (stride.start_s + stride.end_s) / 2
    after = measure_gait(tracks, [Edit("exclude_stride", "left", middle, reason="stumbled")])
    for name in ("stride_time_s", "stance_pct", "knee_flexion_rom_deg", "stride_length_m"):
        assert figure(after, name).n == figure(before, name).n - 1
    assert figure(after, "stride_time_s", "right") == figure(before, "stride_time_s", "right")


def test_the_decision_about_a_stride_survives_a_shift_of_its_contact() -> None:
    tracks = walk.tracks()
    stride = measure_gait(tracks).strides.select_used("left")[2]
    edits = [
        Edit("exclude_stride", "left", (stride.start_s + stride.end_s) / 2, reason="stumbled"),
        Edit("move_event", "left", stride.start_s, "ic", stride.start_s + 0.02),
    ]
    out = [s for s in measure_gait(tracks, edits).strides.strides if s.excluded_by == "person"]
    assert [s.start_s for s in out] == [pytest.approx(stride.start_s + 0.02)]


def test_without_angles_and_paths_there_are_still_times() -> None:
    measured = measure_gait(replace(walk.tracks(), angles=None, feet=None, trunk={}))
    assert figure(measured, "stride_time_s").mean == pytest.approx(walk.STRIDE_S)
    assert "knee_flexion_rom_deg" not in measured.columns


def test_forward_acceleration_is_along_the_way_whatever_way_it_goes() -> None:
    n, heading = 1000, 2.4
    q = multiply(about(2, heading + 0.1 * np.sin(np.arange(n) / 10)), from_matrix(R_NEUTRAL))
    pushed = rotate(about(2, np.full(n, heading)), np.tile([1.0, 0.5, 0.2], (n, 1)))
    np.testing.assert_allclose(
        in_walking_frame(pushed, q, 100.0)[150:-150], [[1.0, 0.5, 0.2]] * 700, atol=0.02
    )
