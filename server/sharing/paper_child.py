"""Process that renders one PDF, which isolates its libraries and memory from the web process.

Started by server/sharing/pdfs.py as `python -m sagittal.server.sharing.paper_child <socket> <parent pid>`.
"""

from __future__ import annotations

import logging

import msgspec

from sagittal.core.errors import SagittalError
from sagittal.core.user_text import encode_user_text
from sagittal.server.processes.child import enter_child
from sagittal.server.report.pdf import render_pdf


class PaperReply(msgspec.Struct, frozen=True):
    """The PDF of a document, or the reason of failure."""

    content: bytes = b""
    code: str = ""
    message: str = ""


def main() -> None:
    """Render the one document received over the channel."""
    line, _ = enter_child()
    try:
        reply = PaperReply(render_pdf(line.receive().decode()))
    except SagittalError as error:
        reply = PaperReply(code=error.code, message=error.message)
    except Exception:
        logging.getLogger(__name__).exception("a PDF could not be made")
        reply = PaperReply(code="internal_error", message="The PDF could not be made; the log says why.")
    line.send(msgspec.msgpack.encode(reply, enc_hook=encode_user_text))


if __name__ == "__main__":
    main()
