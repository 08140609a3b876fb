"""Errands take turns, and only a few wait."""

from __future__ import annotations

import threading

import pytest

from sagittal.server.processes.errand import MOST_WAITING, ErrandTurn, TooManyErrands


def test_a_few_wait_for_their_turn_and_more_are_refused_at_once() -> None:
    turn, let_go, running, most = ErrandTurn(), threading.Event(), [], []

    def run() -> None:
        with turn.take():
            running.append(1)
            most.append(len(running))
            let_go.wait()
            running.pop()

    threads = [threading.Thread(target=run) for _ in range(1 + MOST_WAITING)]
    for thread in threads:
        thread.start()
    try:
        while turn._places._value:  # until all have their places
            pass
        with pytest.raises(TooManyErrands), turn.take():
            pass
    finally:
        let_go.set()
        for thread in threads:
            thread.join()
    assert most == [1] * (1 + MOST_WAITING)
    with turn.take():
        assert not running
