"""Consoles of all pages: errors, warnings and uncaught exceptions, of which tests expect none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final
from urllib.parse import urlsplit

from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, WebError

HEARD: Final = ("error", "warning", "assert")
OF_THE_BROWSER: Final = ("GPU stall due to ReadPixels",)
"""What software WebGL says when a picture is read from it."""
READBACK: Final = "Canvas2D: Multiple readback operations"
ASSETS: Final = ("/static/", "/texts/", "/views/client/")
"""Of what no test provokes the absence."""


class Console:
    """Collect console messages of all watched browsers."""

    def __init__(self) -> None:
        self._messages: list[str] = []

    def watch(self, browser: Browser) -> Browser:
        """Listen to every page that this browser will open."""
        for name in ("new_context", "new_page"):
            setattr(browser, name, self._listening(getattr(browser, name)))
        return browser

    def take(self) -> list[str]:
        """Unexpected messages since the last call."""
        messages, self._messages = self._messages, []
        return messages

    def _listening(self, make: Callable[..., Any]) -> Callable[..., Any]:
        def made(*args: Any, **kwargs: Any) -> Any:
            result = make(*args, **kwargs)
            context = result if isinstance(result, BrowserContext) else result.context
            context.on("console", self._hear)
            context.on("weberror", self._hear_error)
            return result

        return made

    def _hear(self, message: ConsoleMessage) -> None:
        address = message.location.get("url", "")
        if message.type in HEARD and not is_expected(message.text, address):
            self._messages.append(f"{message.type} at {address}: {message.text}")

    def _hear_error(self, error: WebError) -> None:
        location = error.page.url if error.page else ""
        self._messages.append(f"uncaught at {location}: {error.error}")


def is_expected(text: str, address: str) -> bool:
    """Whether a browser message results from a provoked refusal or lost connection."""
    if text.startswith("Failed to load resource"):
        return not urlsplit(address).path.startswith(ASSETS) or "net::ERR" in text
    if text.startswith(READBACK):
        return not address  # a script of the test, not one of the page, reads the canvas
    return text.startswith("WebSocket connection to") or any(words in text for words in OF_THE_BROWSER)
