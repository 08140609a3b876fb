"""Truth as columns: every contact, stride and angle in order, in SI units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.frames import SIDES
from sagittal.core.simulate.script import Stand, Straight
from sagittal.core.simulate.simulation import simulate
from sagittal.core.simulate.tables import angle_table, event_table, stride_table

TRUTH = simulate((Stand(2.0), Straight(3.0, 0.6, 0.5), Stand(1.0)), seed=1).truth


def test_angles_are_those_from_the_truths_own_standing() -> None:
    table = angle_table(TRUTH)
    assert list(table) == ["t_s", *TRUTH.angles]
    assert np.array_equal(table["t_s"], TRUTH.t_s)
    name = "knee_flexion_l"
    assert table[name] == pytest.approx(TRUTH.angles[name] - TRUTH.zero_offset[name])


def test_every_contact_has_a_row_and_every_foot_off_two() -> None:
    table = event_table(TRUTH)
    rows = list(zip(table["time_s"], table["side"], table["kind"], table["source"], strict=True))
    expected = []
    for side in SIDES:
        contacts = TRUTH.contacts[side]
        expected += [(t, side, "ic", "truth") for t in contacts.contact.tolist()]
        expected += [(t, side, "tc", "truth_release") for t in contacts.release.tolist()]
        expected += [(t, side, "tc", "truth_lift5") for t in contacts.lift5.tolist()]
    assert rows == sorted(expected)
    assert len(rows) == 3 * len(TRUTH.footprints["left"][1:] + TRUTH.footprints["right"][1:])


def test_a_foot_that_is_never_up_has_no_second_row() -> None:
    flat = {s: replace(c, lift5=np.full_like(c.lift5, np.nan)) for s, c in TRUTH.contacts.items()}
    sources = event_table(replace(TRUTH, contacts=flat))["source"]
    assert "truth_lift5" not in sources
    assert sources.count("truth_release") == sources.count("truth")  # type: ignore[arg-type]


def test_a_stride_has_both_ends_of_its_contact() -> None:
    table = stride_table(TRUTH)
    assert len(TRUTH.strides) > 2
    for i, stride in enumerate(TRUTH.strides):
        assert {name: column[i] for name, column in table.items()} == {
            "side": stride.side,
            "start_s": stride.start_s,
            "tc_s": stride.lift5_s,
            "release_s": stride.release_s,
            "end_s": stride.end_s,
            "stride_length_m": stride.length_m,
            "stride_width_m": stride.width_m,
            "turn_rad": stride.turn_rad,
        }
        assert stride.lift5_s is not None
        assert stride.start_s < stride.release_s < stride.lift5_s < stride.end_s
