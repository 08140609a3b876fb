"""A simulated walk as a tablet streams it, made once per process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

from sagittal.core.formats.live_log import Hello
from sagittal.core.simulate import simulate_scenario
from sagittal.server.live.follower import Follower
from sagittal.server.live.messages import Command, FeedItem, FollowTake, Report
from sagittal.server.live.playback import DueBatch, cut, hello_of
from sagittal.server.storage.schema.tables import new_id

PER_BATCH = 5


@cache
def walk(per_batch: int = PER_BATCH) -> tuple[DueBatch, ...]:
    """52 s: standing, walking there and back."""
    return tuple(cut(simulate_scenario("comfortable", 3).recording, per_batch))


@cache
def _hello() -> Hello:
    return hello_of(simulate_scenario("comfortable", 3).recording, "0" * 32)


def walk_hello(take: str) -> Hello:
    return replace(_hello(), take=take)


def replayed(
    log: Path,
    *,
    height_m: float = 1.75,
    training: dict[str, object] | None = None,
    commands: Sequence[Command] = (),
) -> list[Report]:
    """All output of an estimator for a whole log."""
    training = training or {}
    message: list[Report] = []
    begin = FollowTake(
        new_id(), str(log), log.stat().st_size, height_m, "walk",
        training.get("prescription"), training.get("baseline"), list(commands),  # type: ignore[arg-type]
    )  # fmt: skip
    follower = Follower(begin, message.append)
    while follower.has_work:
        follower.step()
    follower.show()
    follower.close()
    return message


def items(message: Sequence[Report], kind: str) -> list[FeedItem]:
    return [one for one in message if isinstance(one, FeedItem) and one.kind == kind]
