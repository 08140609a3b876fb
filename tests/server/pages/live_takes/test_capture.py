"""The page of the tablet: open to everybody, alone allowed to use a camera."""

from __future__ import annotations

import re

import pytest

from sagittal.core.frames import SEGMENTS
from sagittal.server.live_takes.live import ALPHABET, CODE_LENGTH
from sagittal.server.pages.live_takes.capture import FILM_BITS_PER_S, PLACES
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio


async def test_it_needs_no_sign_in_and_no_other_page_may_use_a_camera(clinic: Clinic) -> None:
    async with clinic.client() as client:
        page, other_response = await client.get("/capture"), await client.get("/sign-in")
    assert page.status_code == 200
    assert "camera=(self)" in page.headers["permissions-policy"]
    assert "camera=()" in other_response.headers["permissions-policy"]
    assert "".join(re.findall(r'data-key="(\w)"', page.text)) == ALPHABET
    assert f'maxlength="{CODE_LENGTH + 1}"' in page.text  # and the space in the middle
    assert str(clinic.settings.max_file_bytes) in page.text
    assert str(FILM_BITS_PER_S) in page.text


def test_every_segment_that_can_be_worn_has_a_place() -> None:
    assert len(set(PLACES)) == len(PLACES)
    assert set(PLACES) <= set(SEGMENTS)
    assert {p.replace("_l", "_r") for p in PLACES} == {p for p in PLACES if not p.endswith("_l")}
