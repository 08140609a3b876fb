"""Regularity of a lower back's vertical acceleration on mobgap_lowback: straight walks against daily life.

There is no reference of these figures. Held is only that two straight walks of a healthy adult are regular
and short walks about a room less so; the limits are our choice.
"""

from __future__ import annotations

from sagittal.core.parameters.result import Parameter
from sagittal.core.pipeline import analyse
from tests.helpers.mobgap import TRIALS, recording
from validation.figures import record

SHOWN = ("harmonic_ratio_v", "step_regularity_v", "stride_regularity_v")


def test_a_straight_walk_is_more_regular_than_a_room() -> None:
    result: dict[str, dict[str, Parameter]] = {}
    for trial in TRIALS:
        parameters = analyse(recording(trial)).parameters
        result[" ".join(trial)] = {p.name: p for p in parameters if p.name in SHOWN}
    record(
        "Regularity of the trunk on mobgap_lowback",
        ["take", *(f"{name} (strides)" for name in SHOWN)],
        [[take, *(f"{p.mean:.2f} ({p.n})" for p in source.values())] for take, source in result.items()],
        "One healthy older adult: two straight walks of 5 m and two minutes of daily life. No reference; "
        "held: the straight walks have a harmonic ratio above 2 and steps and strides alike by more than "
        "0.5, the room less of each.",
    )
    *straight, room = result.values()
    for walk in straight:
        means = {name: p.mean or 0.0 for name, p in walk.items()}
        assert means["harmonic_ratio_v"] > 2.0
        assert means["step_regularity_v"] > 0.5
        assert means["stride_regularity_v"] > 0.5
        assert all((room[name].mean or 0.0) < value for name, value in means.items())
