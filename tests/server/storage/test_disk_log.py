"""A disk that refuses is two lines of the log: when it begins and when it is over."""

from __future__ import annotations

import errno
import logging
import os

import pytest

from sagittal.server.storage.disk_log import QUIET_S, DiskLog

FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_disk_that_refuses_is_reported_once_and_its_recovery_once(caplog: pytest.LogCaptureFixture) -> None:
    now = [0.0]
    disk = DiskLog(logging.getLogger("test"), lambda: now[0])
    for _ in range(100):
        disk.note_refusal(FULL, "a")
    now[0] = 12.0
    disk.note_success()
    disk.note_success()
    assert [r.getMessage() for r in caplog.records] == [
        "a cannot be written (disk_full); not repeated until writes succeed",
        "writes succeed again, after 12 s",
    ]
    assert all(r.exc_info is None for r in caplog.records)
    disk.note_refusal(FULL, "a")  # on and off
    assert len(caplog.records) == 2
    now[0] = QUIET_S + 1.0
    disk.note_refusal(FULL, "a")
    assert len(caplog.records) == 3


def test_an_error_of_another_kind_has_its_traceback_each_time(caplog: pytest.LogCaptureFixture) -> None:
    disk = DiskLog(logging.getLogger("test"))
    for _ in range(2):
        disk.note_refusal(ValueError("ours"), "a")
    assert all(r.exc_info for r in caplog.records)
    assert len(caplog.records) == 2
    disk.note_success()
    assert len(caplog.records) == 2
