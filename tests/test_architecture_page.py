"""docs/reference/architecture.md shows the rooms and imports that there are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sagittal.core.pipeline import WALK
from tests.helpers.architecture_page import PAGE, PICTURE, find_arrows, find_rooms, render_picture

TEXT = PAGE.read_text("utf-8")


def _package(root: Path, folders: dict[str, str]) -> None:
    for name, source in folders.items():
        folder = root / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "__init__.py").write_text(source, "utf-8")


@pytest.mark.slow
def test_the_picture_of_the_rooms_is_that_of_the_sources() -> None:
    found = PICTURE.search(TEXT)
    assert found is not None
    drawn = set(found.group().removeprefix(found[1]).splitlines())
    expected = set(render_picture().splitlines())
    changes = [f"- {line}" for line in sorted(drawn - expected)]
    changes += [f"+ {line}" for line in sorted(expected - drawn)]
    hint = "run python -m tests.helpers.architecture_page, or change in the page:"
    assert not changes, "\n".join([hint, *changes])


def test_an_arrow_is_an_import_that_does_not_follow_from_others(tmp_path: Path) -> None:
    _package(
        tmp_path,
        {
            "core/low": '"""What lies below. More of it."""',
            "core/middle": '"""Between."""',
            "core/middle/part": "from sagittal.core.low import x\n",
            "server/top": "import sagittal.core.low\nfrom sagittal.core import middle, errors\n",
            "sagittal": "def f():\n    from sagittal.server.top import g\n",
            "web": "",
        },
    )
    assert find_rooms(tmp_path)["core/low"] == "What lies below"
    assert find_arrows(tmp_path) == {
        ("core/middle", "core/low"),
        ("server/top", "core/middle"),
        ("sagittal", "server/top"),
    }


def test_the_picture_of_the_data_flow_names_rooms_and_stages_that_exist() -> None:
    (flow,) = re.findall(r"<!-- flow -->\n(.*?)<!-- end -->", TEXT, re.DOTALL)
    rooms = set(re.findall(r"\b(?:core|server)/\w+", flow))
    assert rooms <= set(find_rooms())
    stages = re.findall(r"<i>([a-z, ]+)</i>", flow)
    assert [name for names in stages for name in names.split(", ")] == [stage.name for stage in WALK]
