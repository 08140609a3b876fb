"""The profile of a walk as pages show it."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from sagittal.server.pages.results.profile import view_profile
from sagittal.server.report.view.profile import ProfileBar, ProfileView

KNEE = ProfileBar("Knee flexion", {"left": 7.25, "right": 4.0}, 4.0, 7.0)
SCORE = ProfileBar("Score", {"left": 9.0}, 5.0, 8.25)


@dataclass
class Model:
    profile: ProfileView | None
    quality: Any = field(default_factory=lambda: SimpleNamespace(kind="ok"))
    since: Any = None


def view(profile: ProfileView | None, kind: str = "ok") -> tuple[dict[str, Any] | None, list[dict[str, Any]]]:
    model: Any = Model(profile, SimpleNamespace(kind=kind))
    reviewed: Any = None
    return view_profile(reviewed, model, {}, 20)


def test_score_and_bars_are_said_with_a_dash_where_a_side_has_none() -> None:
    score, bars = view(ProfileView((), "", "", bars=(KNEE,), score=SCORE))
    assert score == {
        "left": "9.0", "right": "–", "title": "Score", "at_speed": None, "healthy": "8.2", "before": None,
        "change": (),
    }  # fmt: skip
    (bar,) = bars
    assert (bar["title"], bar["left"], bar["right"]) == ("Knee flexion", "7.2", "4.0")
    assert "<svg" in bar["svg"]


def test_people_at_this_speed_stand_beside_and_no_score_leaves_the_bars() -> None:
    at_speed = ProfileBar("Score", {"right": 6.0}, None, None)
    score, _ = view(ProfileView((), "", "", bars=(), score=SCORE, score_at_speed=at_speed))
    assert score is not None
    assert score["at_speed"] == {"left": "–", "right": "6.0"}
    none, bars = view(ProfileView((), "", "", bars=(KNEE,)))
    assert (none, len(bars)) == (None, 1)


def test_of_poor_data_and_without_curves_nothing_is_told() -> None:
    assert view(ProfileView((), "", "", bars=(KNEE,), score=SCORE), "bad") == (None, [])
    assert view(None) == (None, [])
