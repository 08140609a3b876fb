"""What live estimators share: which feet carry a sensor, and that each of them fits the protocol."""

from __future__ import annotations

import inspect

import pytest

from sagittal.core.body.erkf import live_figure as erkf
from sagittal.core.body.l7s import live_figure as l7s
from sagittal.core.body.live_estimator import LivePoseEstimator, list_worn_feet


def test_feet_are_listed_left_first_and_nothing_else() -> None:
    assert list_worn_feet(["foot_r", "pelvis", "foot_l", "shank_l"]) == ("foot_l", "foot_r")
    assert list_worn_feet(("foot_r",)) == ("foot_r",)
    assert list_worn_feet(("pelvis", "chest")) == ()


ESTIMATORS = sorted(
    (
        x
        for module in (erkf, l7s)
        for x in vars(module).values()
        if inspect.isclass(x) and x.__module__ == module.__name__
    ),
    key=lambda x: x.__name__,
)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda x: x.__name__)
def test_every_live_estimator_has_what_the_chain_asks_for(estimator: type) -> None:
    source = inspect.getsource(estimator)
    for name in LivePoseEstimator.__annotations__:
        assert hasattr(estimator, name) or f"self.{name}" in source, name
    assert isinstance(inspect.getattr_static(estimator, "broken"), property)
    for name in ("push", "drain_notices"):
        expected = inspect.signature(getattr(LivePoseEstimator, name))
        assert list(inspect.signature(getattr(estimator, name)).parameters) == list(expected.parameters)
