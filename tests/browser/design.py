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


SIZES = ((1280, 800), (1024, 768), (810, 1080), (360, 740))
"""Desk, laptop, tablet, phone."""


def all_faults(page: Page) -> list[str]:
    """Faults of a page in every size, light and dark."""
    faults = []
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        for scheme in ("light", "dark"):
            # without motion: colours must not be read in the middle of a transition
            page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
            page.wait_for_timeout(30)
            found = layout_faults(page) | text_faults(page)
            faults += [f"{width} {scheme}: {found}"] if found else []
    return faults
