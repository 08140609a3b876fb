"""PDF process: responses to failures."""

from __future__ import annotations

import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest

from sagittal.server.processes.channel import Channel
from sagittal.server.settings import Settings
from sagittal.server.sharing import paper_child
from sagittal.server.sharing.paper_child import PaperReply

Ask = Callable[[bytes], PaperReply]


@pytest.fixture
def ask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ask]:
    """Give the child a document, in this process, and return its answer."""
    ours, theirs = map(Channel, socket.socketpair())
    monkeypatch.setattr(paper_child, "enter_child", lambda: (theirs, Settings(data_dir=tmp_path)))

    def answer(document: bytes) -> PaperReply:
        ours.send(document)
        paper_child.main()
        return msgspec.msgpack.decode(ours.receive(), type=PaperReply)

    yield answer
    ours.close()
    theirs.close()


def test_without_the_library_its_own_refusal_is_the_answer(ask: Ask, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "weasyprint", None)
    reply = ask(b"<html><head></head></html>")
    assert (reply.content, reply.code) == (b"", "pdf_missing")
    assert reply.message


def test_what_goes_wrong_otherwise_is_in_the_log_and_not_in_the_answer(
    ask: Ask, caplog: pytest.LogCaptureFixture
) -> None:
    reply = ask(b"\xff is no text")
    assert (reply.content, reply.code) == (b"", "internal_error")
    assert reply.message == "The PDF could not be made; the log says why."
    assert "UnicodeDecodeError" in caplog.text


def test_an_answer_says_content_or_code() -> None:
    assert PaperReply() == PaperReply(b"", "", "")
    assert (
        msgspec.msgpack.decode(msgspec.msgpack.encode(PaperReply(b"%PDF")), type=PaperReply).content
        == b"%PDF"
    )
