"""How rows of goals are put into docs/performance.md."""

from __future__ import annotations

from validation.figures import put_goal, tell_goal


def test_a_goal_says_whether_it_is_met() -> None:
    assert tell_goal("page", 12.5, 11.04, "ms") == "| page | ≤ 12.5 ms | 11 ms | yes |"
    assert tell_goal("page", 12.5, 14.04, "ms") == "| page | ≤ 12.5 ms | 14 ms | no |"
    assert tell_goal("text", 200.0, 173.2, "MB/s", at_least=True) == "| text | ≥ 200 MB/s | 173 MB/s | no |"


def test_a_goal_that_was_measured_again_keeps_its_place_and_what_stands_below() -> None:
    first = put_goal("", tell_goal("a", 1.0, 0.5, "s"))
    both = put_goal(f"{first}\n\nBy hand.", tell_goal("b", 1.0, 2.0, "s"))
    again = put_goal(both, tell_goal("a", 1.0, 1.5, "s"))
    lines = again.splitlines()
    assert lines[2:4] == ["| a | ≤ 1 s | 1.5 s | no |", "| b | ≤ 1 s | 2 s | no |"]
    assert again.endswith("\n\nBy hand.")
    assert again.count("| a |") == 1
