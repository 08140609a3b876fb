from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.angles.measure import measure_angles
from sagittal.core.frames import SIDES, SUFFIX
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.simulate import Simulation, angle_table, event_table, stride_table


@pytest.mark.slow
def test_truth_and_analysis_mean_the_same_angles(mixed: Simulation) -> None:
    """Two derivations of docs/science/joint-angles.md, one here and one in core/angles."""
    truth = mixed.truth
    valid = {segment: np.ones(len(truth.t_s), bool) for segment in truth.q}
    orientations = Orientations(truth.t_s, truth.rate_hz, truth.q, valid, engine="truth")
    analysed = measure_angles(orientations, truth.zero)
    assert set(analysed.angles) == set(truth.angles)
    for name, values in truth.subtract_standing().items():
        assert analysed.angles[name] == pytest.approx(values, abs=1e-9), name
        assert analysed.zero_offset[name] == pytest.approx(truth.zero_offset[name], abs=1e-9), name


@pytest.mark.slow
def test_the_zero_is_quiet_standing(comfortable: Simulation) -> None:
    truth = comfortable.truth
    inside = (truth.t_s >= truth.zero[0]) & (truth.t_s < truth.zero[1])
    assert truth.zero[1] - truth.zero[0] > 3.0
    for name, values in truth.subtract_standing().items():
        assert np.abs(values[inside]).max() < 1e-6, name
    assert np.degrees(truth.zero_offset["knee_flexion_l"]) == pytest.approx(5.0, abs=0.3)


def test_events_alternate_and_stances_overlap(comfortable: Simulation) -> None:
    truth = comfortable.truth
    for side in SIDES:
        e = truth.contacts[side]
        assert (e.heel_off < e.release).all()
        assert (e.release < e.lift5).all()
        assert (e.lift5 < e.contact).all()
        assert (e.contact < e.flat).all()
        assert (e.flat[:-1] < e.heel_off[1:]).all()
    assert (truth.contact["left"] | truth.contact["right"]).all(), "walking has no flight"
    assert not (truth.flat["left"] & ~truth.contact["left"]).any()


def test_stride_figures_are_those_of_the_script(comfortable: Simulation) -> None:
    truth = comfortable.truth
    k = 1.75 / 1.745
    for side in SIDES:
        strides = [s for s in truth.strides if s.side == side]
        assert len(strides) >= 20
        steady = strides[2:18]
        assert np.mean([s.length_m for s in steady]) == pytest.approx(2 * 0.64 * k, rel=0.02)
        assert np.mean([s.end_s - s.start_s for s in steady]) == pytest.approx(1.08, rel=0.02)
        assert np.mean([s.width_m for s in steady]) == pytest.approx(0.10 * k, abs=0.01)
        share = np.mean([(s.release_s - s.start_s) / (s.end_s - s.start_s) for s in steady])
        assert share == pytest.approx(0.594, abs=0.01)
        assert all(abs(s.turn_rad) < 1e-12 for s in steady)


def test_no_stride_has_standing_in_it(comfortable: Simulation) -> None:
    for stride in comfortable.truth.strides:
        for start, end in comfortable.truth.stands:
            assert not (stride.start_s <= start and end <= stride.end_s)


def test_turning_strides_add_up_to_the_turn(mixed: Simulation) -> None:
    prints = mixed.truth.footprints["left"]
    assert prints[-1].foot_rad - prints[0].foot_rad == pytest.approx(np.pi, abs=1e-9)


def test_tables_have_the_columns_of_an_analysis(comfortable: Simulation) -> None:
    truth = comfortable.truth
    angles = angle_table(truth)
    assert next(iter(angles)) == "t_s"
    assert {f"{name}_{SUFFIX[s]}" for s in SIDES for name in ("hip_flexion", "knee_rotation")} <= set(angles)
    assert {len(column) for column in angles.values()} == {len(truth.t_s)}

    events = event_table(truth)
    assert list(events) == ["time_s", "side", "kind", "source"]
    assert events["time_s"] == sorted(events["time_s"])  # type: ignore[type-var]
    assert set(events["kind"]) == {"ic", "tc"}
    assert events["kind"].count("ic") == sum(len(truth.contacts[s].contact) for s in SIDES)  # type: ignore[arg-type]

    strides = stride_table(truth)
    assert {"side", "start_s", "tc_s", "end_s", "stride_length_m"} <= set(strides)
    assert {len(column) for column in strides.values()} == {len(truth.strides)}
