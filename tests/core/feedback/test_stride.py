"""A live stride has all that feedback reads of one."""

from __future__ import annotations

from dataclasses import fields
from typing import get_type_hints

from sagittal.core.feedback.stride import StrideLike
from sagittal.core.parameters.live.live_stride import LiveStride
from tests.helpers.feedback import Walked


def test_strides_of_the_chain_and_of_tests_have_every_field_with_its_type() -> None:
    expected_by_name = {
        name: get_type_hints(x.fget)["return"]
        for name, x in vars(StrideLike).items()
        if isinstance(x, property) and x.fget is not None
    }
    assert {"n", "side", "detected_s", "values", "curves", "counted"} < set(expected_by_name)
    for kind in (LiveStride, Walked):
        by_name = {f.name: get_type_hints(kind)[f.name] for f in fields(kind)}
        assert {name: by_name.get(name) for name in expected_by_name} == expected_by_name
