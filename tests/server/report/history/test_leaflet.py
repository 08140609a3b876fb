"""The patient's leaflet calls nothing a change that is none, and an estimate an estimate."""

from __future__ import annotations

from sagittal.core.change import parameter_changes
from sagittal.core.parameters.result import Parameter
from sagittal.server.report.history.leaflet import LeafletFigure, list_figures


def knee(degrees: float, *, estimated: bool = False) -> Parameter:
    return Parameter("knee_flexion_rom_deg", "left", 40, degrees, 1.0, "deg", estimated=estimated)


def tell(earlier: Parameter | None, later: Parameter) -> LeafletFigure:
    changes = () if earlier is None else parameter_changes([earlier], [later], "left")
    (result,) = list_figures([later, Parameter("step_length_m", "left", 0, None, None, "m")], changes, "left")
    return result


def test_what_was_measured_in_another_way_is_not_set_beside_it() -> None:
    notices = tell(knee(40.0), knee(60.0, estimated=True))
    assert (notices.now, notices.before, notices.estimated) == ("60 degrees", None, True)
    assert "differently" in notices.words
    assert tell(None, knee(60.0)).words == "There is no earlier value to compare with."


def test_a_change_is_named_beyond_the_measurement_error_alone() -> None:
    # 1.96 sqrt 2 times 1.86 degrees, of the affected knee (Guzik 2020)
    assert tell(knee(50.0), knee(55.0)).words == "This is about the same as last time."
    assert tell(knee(50.0), knee(55.3)).words == "This is further than last time."
    assert tell(knee(50.0), knee(44.7)).words == "This is less far than last time."
    assert tell(knee(50.0), knee(55.3)).before == "50 degrees"
