"""An estimator that sleeps delays pictures, and no acknowledgement."""

from __future__ import annotations

import asyncio
import subprocess
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from sagittal.server.live.client import StreamReport, stream
from sagittal.server.live.playback import DueBatch, pace_batches
from sagittal.server.live.pool import MODULE
from tests.data import ROOT
from tests.helpers.clinic import Clinic, open_clinic
from tests.helpers.live_clinic import heard, visit
from tests.helpers.live_walk import walk, walk_hello
from tests.server.live.sleepy_estimator import SLEEP_S
from tests.server.serving import serve

pytestmark = pytest.mark.anyio

SECONDS = 4.0
GROUP_S = 0.25
"""Longest time to an acknowledgement when nothing else happens (docs/reference/live-protocol.md)."""


def some_of_the_walk() -> Sequence[DueBatch]:
    return [one for one in walk() if one.at_s < SECONDS]


async def streamed(clinic: Clinic, port: int, pictures: list[dict[str, Any]]) -> StreamReport:
    """Stream at real speed while a browser keeps the pictures."""

    async def look(feed: Any) -> None:
        while True:
            pictures.append(await heard(feed, "frame"))

    async with visit(clinic, port) as v, v.feed() as feed:
        looking = asyncio.create_task(look(feed))
        report = await stream(v.socket, v.token, walk_hello(v.take), pace_batches(some_of_the_walk(), 1.0))
        looking.cancel()
        await asyncio.gather(looking, return_exceptions=True)
    return report


@pytest.fixture
async def sleepy(
    tmp_path: Path, anyio_backend: str, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[tuple[Clinic, int]]:
    """A clinic with a sleepy estimator that is warm."""
    start = subprocess.Popen

    def other(words: list[str], *args: Any, **options: Any) -> Any:
        changed = ["tests.server.live.sleepy_estimator" if w == MODULE else w for w in words]
        if changed != words:
            options["env"] = {**options["env"], "PYTHONPATH": str(ROOT)}
        return start(changed, *args, **options)

    monkeypatch.setattr(subprocess, "Popen", other)
    async with open_clinic(tmp_path, live_workers=1) as clinic, serve(clinic.app) as port:
        pool = clinic.app.state.hub.pool
        async with asyncio.timeout(180):
            while not pool.is_ready:
                await asyncio.sleep(0.05)
        yield clinic, port


@pytest.mark.slow
async def test_an_estimator_that_sleeps_delays_no_acknowledgement(
    clinic: Clinic, port: int, sleepy: tuple[Clinic, int]
) -> None:
    none: list[dict[str, Any]] = []
    late: list[dict[str, Any]] = []
    single = await streamed(clinic, port, none)
    neighbour = await streamed(*sleepy, late)
    assert not none
    assert 0 < len(late) <= SECONDS / SLEEP_S + 2  # it did sleep, 30 would come in a second
    assert any(picture["stale"] for picture in late)
    assert len(neighbour.ack_s) == len(single.ack_s) == len(some_of_the_walk())
    assert neighbour.ack_quantile(0.5) < max(GROUP_S, 1.5 * single.ack_quantile(0.5))
    assert (
        neighbour.ack_quantile(0.99) < max(2 * GROUP_S, 2.0 * single.ack_quantile(0.99)) < SLEEP_S + GROUP_S
    )
