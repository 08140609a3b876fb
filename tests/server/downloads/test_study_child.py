"""Responses of the study process."""

from __future__ import annotations

import io
import socket
import zipfile
from collections.abc import Callable, Iterator

import msgspec
import pytest

from sagittal.core.user_text import encode_user_text
from sagittal.server.auth.identity import Identity
from sagittal.server.auth.roles import Role
from sagittal.server.downloads import study_child
from sagittal.server.downloads.studies import StudyChoice
from sagittal.server.downloads.study_child import StudyReply
from sagittal.server.processes.channel import Channel
from sagittal.server.report.study_tables import PROVENANCE
from tests.helpers.clinic import Clinic
from tests.server import feedback

ADMIN = Identity("u", "ada", "Ada", Role.ADMIN, "l")
Ask = Callable[[bytes], StudyReply]


@pytest.fixture
def ask(stored: Clinic, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ask]:
    """Give the child an order, in this process, and return its answer."""
    ours, theirs = map(Channel, socket.socketpair())
    monkeypatch.setattr(study_child, "enter_child", lambda: (theirs, stored.settings))

    def answer(order: bytes) -> StudyReply:
        ours.send(order)
        study_child.main()
        return msgspec.msgpack.decode(ours.receive(), type=StudyReply)

    yield answer
    ours.close()
    theirs.close()


def order(choice: StudyChoice) -> bytes:
    return msgspec.msgpack.encode((ADMIN, choice), enc_hook=encode_user_text)


def test_the_tables_come_as_a_zip_with_the_visits_in_them(stored: Clinic, ask: Ask) -> None:
    session = feedback.walked(stored, feedback.person(stored), 0, 12.0)
    reply = ask(order(StudyChoice(visits=frozenset({session}))))
    assert (reply.code, reply.visits) == ("", (session,))
    names = zipfile.ZipFile(io.BytesIO(reply.content)).namelist()
    assert {"strides.csv", "takes.parquet", PROVENANCE} <= set(names)


def test_a_choice_of_nothing_is_refused_with_its_own_code(ask: Ask) -> None:
    reply = ask(order(StudyChoice(visits=frozenset())))
    assert (reply.code, reply.content, reply.visits) == ("no_visits", b"", ())
    assert reply.message.startswith("No visit matches.")


def test_what_goes_wrong_otherwise_is_in_the_log_and_not_in_the_answer(
    ask: Ask, caplog: pytest.LogCaptureFixture
) -> None:
    reply = ask(b"\xc1 is no order")
    assert (reply.code, reply.message) == (
        "internal_error",
        "The tables could not be made; the log says why.",
    )
    assert "a study could not be made" in caplog.text
