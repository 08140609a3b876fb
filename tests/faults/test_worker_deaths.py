"""Jobs survive the death of their worker: one visible result (docs/how-to/operations.md, "One machine")."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import pytest
from sqlalchemy.exc import OperationalError

from sagittal.server.processes.environment import make_environment
from sagittal.server.processes.supervisor import Workers
from sagittal.server.settings import Settings
from tests.faults.clinic import Clinic, alive, state_of, until
from tests.faults.tiny_tasks import STAGES
from tests.helpers.engines import on_both_engines


def children_of(pid: int) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(word) for word in text.split()]


def test_a_job_is_done_with_its_result_stored_and_the_warm_child_kept_for_the_next(
    clinic: Clinic, workers: Workers
) -> None:
    view = clinic.ended(clinic.submit())
    assert (view.state, view.attempt, view.stage, view.fraction) == ("done", 1, view.stage, 1.0)
    [result] = clinic.results()
    assert result.job_id == view.id
    assert clinic.blobs.read(clinic.patient.id, result.files["result.txt"].sha256) == b"signals"

    def child_at(stage: str) -> str:
        view, reached, gate = clinic.hold(stage)
        pid = until(lambda: reached.exists() and reached.read_text())
        gate.touch()
        clinic.ended(view)
        return str(pid)

    assert child_at("first") == child_at("second")


@on_both_engines
def test_a_worker_killed_at_any_stage_is_replaced_and_the_job_has_one_result(
    clinic: Clinic, workers: Workers
) -> None:
    done = []
    for stage in (*STAGES, "publish"):
        view, reached, gate = clinic.hold(stage)
        until(reached.exists)
        [worker] = workers.pids
        os.kill(worker, signal.SIGKILL)
        gate.touch()
        ended = clinic.ended(view)
        assert (ended.state, ended.attempt) == ("done", 2), stage
        assert workers.pids != [worker]
        done.append(view.id)
        assert sorted(r.job_id for r in clinic.results()) == sorted(done), stage


@pytest.mark.parametrize("clinic", [Settings().lease_s], indirect=True)
@pytest.mark.parametrize("busy", [False, True])
def test_a_child_does_not_outlive_its_worker(clinic: Clinic, workers: Workers, busy: bool) -> None:
    if busy:
        view = clinic.submit(spin=True)
        until(lambda: clinic.row(view).stage == STAGES[-1])
    else:
        _, reached, _ = clinic.hold("second")
        until(reached.exists)
    [worker] = workers.pids
    [child] = children_of(worker)
    os.kill(worker, signal.SIGKILL)
    until(lambda: not alive(child))


@pytest.mark.death
@on_both_engines
@pytest.mark.first
def test_a_killed_child_is_replaced_by_the_same_worker(clinic: Clinic, workers: Workers) -> None:
    view, reached, gate = clinic.hold("second")
    until(reached.exists)
    [worker] = workers.pids
    os.kill(int(reached.read_text()), signal.SIGKILL)
    gate.touch()
    assert clinic.ended(view).state == "done"
    assert clinic.row(view).deaths == 1
    assert workers.pids == [worker]
    assert len(clinic.results()) == 1


@on_both_engines
def test_a_job_that_kills_three_workers_is_given_up(clinic: Clinic, workers: Workers) -> None:
    view = clinic.ended(clinic.submit(die_at="second"))
    assert (view.state, view.error_code, view.attempt) == ("failed", "worker_died", 3)
    assert view.error_message is not None
    assert "worker died 3 times" in view.error_message
    assert clinic.results() == []
    assert clinic.ended(clinic.submit()).state == "done"


def freeze_outside_a_transaction(clinic: Clinic, pid: int) -> None:
    """Stop a process where it holds no lock of the database: others can write."""

    def freeze() -> bool:
        os.kill(pid, signal.SIGSTOP)
        until(lambda: state_of(pid) == "T")
        try:
            clinic.db.probe()
        except OperationalError:
            os.kill(pid, signal.SIGCONT)
            return False
        return True

    until(freeze)


@on_both_engines
def test_a_frozen_worker_is_fenced_when_it_wakes(clinic: Clinic, workers: Workers) -> None:
    view, reached, gate = clinic.hold("third")
    until(reached.exists)
    [frozen] = workers.pids
    second = Workers(clinic.settings)
    try:
        freeze_outside_a_transaction(clinic, frozen)
        reached.unlink()
        second.start()
        until(reached.exists)  # the second attempt is at the gate: the first one's lease has run out
        gate.touch()
        done = clinic.ended(view)
    finally:
        os.kill(frozen, signal.SIGCONT)
    second.stop()
    assert (done.state, done.attempt) == ("done", 2)
    assert clinic.ended(clinic.submit()).state == "done"  # the woken one threw its result away and works on
    assert workers.pids == [frozen]
    assert clinic.row(view).attempt == 2
    assert [r.job_id for r in clinic.results()].count(view.id) == 1


@on_both_engines
def test_a_worker_frozen_while_it_writes_stops_the_others_only_until_it_wakes(
    clinic: Clinic, workers: Workers, capfd: pytest.CaptureFixture[str]
) -> None:
    view, reached, gate = clinic.hold("publish")  # in the transaction that writes the result
    waiting = clinic.submit()
    until(reached.exists)
    [frozen] = workers.pids
    second = Workers(clinic.settings)
    names: list[str] = []

    def has_said(words: str) -> bool:
        names.append(capfd.readouterr().err)
        return words in "".join(names)

    os.kill(frozen, signal.SIGSTOP)
    try:
        second.start()
        [patient] = second.pids
        until(lambda: has_said("the database has been busy"))
        child = children_of(patient)
        gate.touch()
    finally:
        os.kill(frozen, signal.SIGCONT)
    assert [clinic.ended(one).state for one in (view, waiting)] == ["done", "done"]
    assert (workers.pids, second.pids, children_of(patient)) == ([frozen], [patient], child)
    second.stop()
    assert sorted(r.job_id for r in clinic.results()) == sorted([view.id, waiting.id])
    assert "Traceback" not in "".join(names)


@on_both_engines
@pytest.mark.parametrize("clinic", [Settings().lease_s], indirect=True)
def test_cancel_stops_the_child_at_any_stage_within_two_seconds(clinic: Clinic, workers: Workers) -> None:
    for stage in STAGES:
        view, reached, _ = clinic.hold(stage)
        child = int(until(lambda at=reached: at.exists() and at.read_text()))  # type: ignore[misc]
        with clinic.db.write() as c:
            requests = clinic.queue.cancel(c, view.id)
        assert requests is not None
        assert (requests.state, requests.cancel_requested) == ("running", True)
        assert clinic.ended(view, patience_s=2.0).state == "cancelled", stage
        assert not alive(child)
        assert clinic.results() == []


@pytest.mark.parametrize("clinic", [Settings().lease_s], indirect=True)
def test_cancel_stops_a_child_that_never_speaks(clinic: Clinic, workers: Workers) -> None:
    view = clinic.submit(spin=True)
    until(lambda: clinic.row(view).stage == STAGES[-1])
    with clinic.db.write() as c:
        clinic.queue.cancel(c, view.id)
    assert clinic.ended(view, patience_s=2.0).state == "cancelled"


@on_both_engines
def test_a_failure_keeps_its_reason_and_the_worker(clinic: Clinic, workers: Workers) -> None:
    began = workers.pids
    for error, code in (("known", "no_walking"), ("bug", "internal_error"), ("memory", "out_of_memory")):
        view = clinic.ended(clinic.submit(error=error))
        assert (view.state, view.error_code, view.attempt) == ("failed", code, 1)
        assert view.error_message
        assert clinic.ended(clinic.submit()).state == "done"
    assert workers.pids == began


def test_a_job_beyond_its_time_is_stopped(clinic: Clinic, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clinic, "settings", _with(clinic, job_timeout_s=1.0))
    workers = Workers(clinic.settings)
    workers.start()
    try:
        view = clinic.ended(clinic.submit(spin=True))
    finally:
        workers.stop()
    assert (view.state, view.error_code) == ("failed", "job_timeout")


@on_both_engines
def test_stopping_gives_the_job_back_unharmed(clinic: Clinic, workers: Workers) -> None:
    view, reached, _ = clinic.hold("second")
    until(reached.exists)
    child = int(reached.read_text())
    stopping = threading.Thread(target=workers.stop)
    stopping.start()
    stopping.join(10.0)
    assert not stopping.is_alive()
    assert not alive(child)
    row = clinic.row(view)
    assert (row.state, row.deaths, row.worker) == ("queued", 0, None)


@on_both_engines
def test_a_killed_server_takes_worker_and_child_along_and_the_next_one_goes_on(clinic: Clinic) -> None:
    script = textwrap.dedent("""
        import sys, time
        from sagittal.server.processes.supervisor import Workers
        from sagittal.server.settings import load_settings
        workers = Workers(load_settings())
        workers.start()
        print(*workers.pids, flush=True)
        time.sleep(600)
    """)
    server = subprocess.Popen(
        [sys.executable, "-c", script],
        env=make_environment(clinic.settings),
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdout is not None
    try:
        worker = int(server.stdout.readline())
        view, reached, gate = clinic.hold("second")
        until(reached.exists)
        child = int(reached.read_text())
        assert children_of(worker) == [child]
    finally:
        server.kill()
        server.wait()
        server.stdout.close()
    until(lambda: not alive(worker) and not alive(child))
    gate.touch()
    next_one = Workers(clinic.settings)
    next_one.start()
    try:
        done = clinic.ended(view)
    finally:
        next_one.stop()
    # the worker gave it back when its server was gone: a second claim, and still the first attempt
    assert (done.state, done.attempt, clinic.row(view).attempt) == ("done", 1, 2)
    assert len(clinic.results()) == 1


def _with(clinic: Clinic, **values: float) -> object:
    import dataclasses

    return dataclasses.replace(clinic.settings, **values)  # type: ignore[arg-type]
