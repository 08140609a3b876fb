"""The rules for tests detect planted violations."""

from __future__ import annotations

import ast

import pytest

from tests.data import HERE, data_folder
from tests.lint.conventions import (
    compare_with_exceptions,
    find_checking_names,
    find_limits_in_seconds,
    find_mute_tests,
    waits_for_fixed_time,
)


def test_a_mute_test_is_found_and_one_that_asks_a_helper_is_not() -> None:
    tree = ast.parse(
        "def check(x): assert x\n"
        "def ask(x): check(x)\n"
        "def test_asks(): ask(1)\n"
        "def test_refuses():\n    with pytest.raises(ValueError): int('x')\n"
        "def test_says_nothing(): print(len('abc'))\n"
    )
    assert find_mute_tests(tree, find_checking_names([tree])) == ["test_says_nothing"]


@pytest.mark.parametrize(
    "limit", ["time.monotonic() - began < 2", "took <= 2", "2 > took", "0.1 < took < 2", "best < 2"]
)
def test_a_limit_in_seconds_is_found(limit: str) -> None:
    source = f"""
def test():
    began = time.perf_counter()
    took = time.perf_counter() - began
    best = min(1, took)
    assert {limit}
"""
    assert len(find_limits_in_seconds(ast.parse(source))) == 1


def test_a_limited_wait_and_a_shortest_time_are_none() -> None:
    source = "def test():\n    assert clock.monotonic() < end\n    assert time.monotonic() - began > 2"
    assert find_limits_in_seconds(ast.parse(source)) == []


@pytest.mark.recorded
def test_the_recordings_in_this_folder_are_the_very_files_of_the_others() -> None:
    """So what passes without the others need not run again with them."""
    base = data_folder()
    own = [p.relative_to(HERE) for p in HERE.rglob("*.csv")]
    assert own
    for name in own:
        assert (HERE / name).read_bytes() == (base / name).read_bytes()


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("time.sleep(1)", True),
        ("if x:\n        page.wait_for_timeout(30)", True),
        ("while not done():\n        time.sleep(0.1)", False),
        ("await asyncio.sleep(0)", False),
    ],
)
def test_a_fixed_wait_is_found_and_polling_is_not(body: str, expected: bool) -> None:
    assert waits_for_fixed_time(ast.parse(f"async def test():\n    {body}").body[0]) == expected


def test_exceptions_may_only_shrink() -> None:
    assert compare_with_exceptions({"a", "b"}, {"b"}) == ["a"]
    assert compare_with_exceptions({"a"}, {"a", "b"}) == ["remove the exception: b"]
