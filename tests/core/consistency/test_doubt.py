"""A doubt is stored with the tracks and read again."""

from __future__ import annotations

import json

from sagittal.core.consistency.doubt import LAWS, NOT_WALKING, Doubt, read_doubt
from sagittal.core.errors import Notice


def test_a_doubt_is_what_it_was_after_it_was_stored() -> None:
    doubt = Doubt(Notice(NOT_WALKING, "Nobody walks like this.", "pelvis", 2.0), "all")
    assert read_doubt(json.loads(json.dumps(doubt.to_json()))) == doubt
    assert doubt.notice.code in LAWS
