"""Exchange of a trial's short pairing code for a stream token, like the tablet page."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from sagittal.core.formats.json_tree import read_json
from sagittal.core.message import Message
from sagittal.server.live.sender import LiveError


@dataclass(frozen=True)
class PairingResult:
    """Result of pairing: `socket` is a complete ws:// or wss:// URL."""

    token: str
    take: str
    session_title: str
    patient_code: str
    socket: str


def pair(address: str, code: str) -> PairingResult:
    """Pair with the server at an http:// or https:// URL.

    Raises
    ------
    LiveError
        bad_address, unreachable, or the server's code (code_not_valid, too_many_attempts …).
    """
    parts = urlsplit(address if "//" in address else f"http://{address}")
    if parts.scheme not in {"http", "https"} or not parts.netloc:
        raise LiveError("bad_address", f"'{address}' is no address of a server; give http://host:port.")
    base = urlunsplit((parts.scheme, parts.netloc, "", "", ""))
    request = urllib.request.Request(  # noqa: S310 - the scheme is checked above
        f"{base}/api/v1/live/pairings",
        data=json.dumps({"code": code}).encode(),
        headers={"Content-Type": "application/json"},
    )
    # ignore the environment's proxy, which does not apply to a loopback server
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        with opener.open(request, timeout=20) as answer:
            reply: Any = read_json(answer.read())
    except urllib.error.HTTPError as refused:
        raise _refusal(refused) from None
    except (OSError, ValueError) as error:
        cause = getattr(error, "reason", error)
        reason = getattr(cause, "strerror", None) or cause
        raise LiveError(
            "unreachable",
            f"{base} cannot be reached ({reason}); is the server running, and the address right?",
        ) from None
    scheme = "wss" if parts.scheme == "https" else "ws"
    return PairingResult(
        token=reply["token"],
        take=reply["take"],
        session_title=reply.get("session_title") or "",
        patient_code=reply.get("patient_code") or "",
        socket=urlunsplit((scheme, parts.netloc, reply["socket"], "", "")),
    )


def _refusal(refused: urllib.error.HTTPError) -> LiveError:
    try:
        problem: Any = read_json(refused.read())
        return LiveError(str(problem["code"]), str(problem["detail"]))
    except (ValueError, KeyError, TypeError):
        return LiveError(
            "unreachable", Message("The server answered HTTP {code}; is it Sagittal?", code=refused.code)
        )
