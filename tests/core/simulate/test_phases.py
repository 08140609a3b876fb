"""Named stretches of a take as a table."""

from __future__ import annotations

from sagittal.core.simulate.phases import Phase, phase_table


def test_phases_are_columns_in_their_order() -> None:
    phases = (Phase("sit", 0.0, 2.0), Phase("stand", 2.0, 3.5))
    table = phase_table(phases)
    assert table == {"start_s": [0.0, 2.0], "end_s": [2.0, 3.5], "kind": ["sit", "stand"]}
    assert list(table) == ["start_s", "end_s", "kind"]
    assert phase_table(()) == {"start_s": [], "end_s": [], "kind": []}
