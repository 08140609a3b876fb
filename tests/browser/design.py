"""The checks of the design system on a live page: contrast, size of targets and text, clipping, scroll."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from playwright.sync_api import Page

CHECKS = (Path(__file__).parent / "design.js").read_text()


def layout_faults(page: Page) -> dict[str, Any]:
    """What of the layout breaks the design rules; empty when nothing does."""
    found: dict[str, Any] = page.evaluate(f"{CHECKS}.layout()")
    return {k: v for k, v in found.items() if v}


def text_faults(page: Page) -> dict[str, str]:
    """Text that is too faint or too small, with a sample."""
    faults: dict[str, str] = page.evaluate(f"{CHECKS}.text()")
    return faults
