"""Whoever needs the filters first compiles them; others wait and find them."""

from __future__ import annotations

import importlib
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Event

import pytest

from sagittal.server.processes import compiling
from sagittal.server.storage.compile_cache import VARIABLE, has_compiled_filters


def test_of_many_that_ask_at_once_one_compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, requests = tmp_path / "filters", []

    def compile_slowly(orders: object) -> None:
        requests.append(orders)
        time.sleep(0.05)
        (folder / "kernel.nbi").touch()

    monkeypatch.setenv(VARIABLE, str(folder))
    monkeypatch.setattr(compiling, "compile_filters", compile_slowly)
    with ThreadPoolExecutor(4) as pool:
        for done in [pool.submit(compiling.compile_filters_once, compiling.OFFLINE) for _ in range(4)]:
            done.result()
    assert requests == [compiling.OFFLINE]


def test_who_comes_in_the_middle_waits_for_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun = Event()

    def compile_slowly(_: object) -> None:
        (tmp_path / "first.nbi").touch()
        begun.set()
        time.sleep(0.05)
        (tmp_path / "last.nbi").touch()

    monkeypatch.setenv(VARIABLE, str(tmp_path))
    monkeypatch.setattr(compiling, "compile_filters", compile_slowly)
    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(compiling.compile_filters_once)
        assert begun.wait(10.0)
        assert compiling.is_compiling()
        compiling.compile_filters_once()
        assert (tmp_path / "last.nbi").exists()
        running.result()
    assert not compiling.is_compiling()


def test_a_filter_that_does_not_compile_is_left_to_its_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    compiling.compile_filters_once(((("core.nowhere", "compile_nothing"),), (("math", "nothing"),)))
    assert not has_compiled_filters()


@pytest.mark.parametrize("order", [*compiling.ALL])
def test_every_order_names_what_there_is(order: compiling.Order) -> None:
    for room, name in order:
        assert callable(getattr(importlib.import_module(room), name))
