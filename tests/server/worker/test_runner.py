"""The worker's hold on its child: orders, words, and death."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from sagittal.server.processes.child import start_child
from sagittal.server.settings import Settings
from sagittal.server.worker import runner
from sagittal.server.worker.messages import ChildReady, Order, Stage, encode
from sagittal.server.worker.runner import Child, ChildDiedError

PATIENCE_S = 60.0
OBEDIENT = """
import os, socket, struct, sys

line = socket.socket(fileno=int(sys.argv[1])).makefile("rwb")

def say(message):
    line.write(struct.pack("!Q", len(message)) + message)
    line.flush()

say({ready!r})
while head := line.read(8):
    order = line.read(struct.unpack("!Q", head)[0])
    if b"die" in order:
        os._exit(3)
    say({stage!r})
"""
"""Is ready at once and says of every order that a stage begins, without our libraries."""


@pytest.fixture
def child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Child]:
    ready, stage = (encode(word) for word in (ChildReady(), Stage("reading", 0.5)))
    (tmp_path / "obedient.py").write_text(OBEDIENT.format(ready=ready, stage=stage))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    # a real process on a real line; only its module is another one than sagittal.server.worker.child
    monkeypatch.setattr(runner, "start_child", lambda module, *given: start_child("obedient", *given))
    result = Child(Settings(data_dir=tmp_path))
    yield result
    result.kill()


def order(kind: str) -> Order:
    return Order(kind, None, [], {})


def test_a_child_is_ready_answers_and_is_silent_when_it_has_nothing_to_say(child: Child) -> None:
    assert child.receive(PATIENCE_S) == ChildReady()
    assert child.receive(0.0) is None
    child.send(order("analyse"))
    assert child.receive(PATIENCE_S) == Stage("reading", 0.5)
    assert child.receive(0.0) is None


def test_who_ends_without_an_answer_is_dead_with_its_status(child: Child) -> None:
    child.receive(PATIENCE_S)
    child.send(order("die"))
    with pytest.raises(ChildDiedError, match=f"computing process {child.pid} ended with status 3"):
        child.receive(PATIENCE_S)


def test_who_was_killed_takes_no_order(child: Child) -> None:
    child.kill()
    with pytest.raises(ChildDiedError, match="ended with status -9"):
        child.send(order("analyse"))
