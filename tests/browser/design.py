"""The checks of the design system on a live page: contrast, size of targets and text, clipping, scroll."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Final, Literal

from playwright.sync_api import Page

from tests.data import ROOT

AXE: Final = Path(os.environ.get("SAGITTAL_AXE") or ROOT / "node_modules" / "axe-core" / "axe.min.js")
"""The checker of WCAG rules, `npm install axe-core` in this folder or elsewhere; only the CI must have it."""

TAGS: Final = ("wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa")

RUN_AXE = """async ([tags, rules]) => (await axe.run(document, {
    runOnly: { type: 'tag', values: tags }, rules, resultTypes: ['violations'], preload: false })).violations
  .map((v) => `${v.id} (${v.impact}): ${v.nodes.map((n) => n.target.join(' ')).slice(0, 3).join('; ')}`)"""

CHECKS = (Path(__file__).parent / "design.js").read_text()


def layout_faults(page: Page) -> dict[str, Any]:
    """What of the layout breaks the design rules; empty when nothing does."""
    fields: dict[str, Any] = page.evaluate(f"{CHECKS}.layout()")
    return {k: v for k, v in fields.items() if v}


def text_faults(page: Page) -> dict[str, str]:
    """Text that is too faint or too small, with a sample."""
    faults: dict[str, str] = page.evaluate(f"{CHECKS}.text()")
    return faults


def axe_faults(page: Page, *, contrast: bool = True) -> list[str]:
    """WCAG 2.2 AA violations that axe finds on the page; empty where axe is not installed.

    Parameters
    ----------
    contrast : include the contrast of text, the slowest rule; `text_faults` reports it too.
    """
    if not AXE.exists():
        return []
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(AXE.read_text())
    rules = {"color-contrast": {"enabled": contrast}}
    names: list[str] = page.evaluate(RUN_AXE, [list(TAGS), rules])
    return names


SIZES = ((1280, 800), (1024, 768), (810, 1080), (360, 740))
"""Desk, laptop, tablet, phone."""
DESK_PX, UPRIGHT_PX = SIZES[0][0], SIZES[2][0]
Scheme = Literal["light", "dark"]
SCHEMES: Final[tuple[tuple[Scheme, ...], ...]] = (("light", "dark"), ("light",), ("dark",), ("dark", "light"))
"""In which colours each size is looked at.

Left out: the laptop in the dark and the tablet in the light, and the layout in a size's second scheme. A
scheme changes colours alone, and what is shown in between is shown on the desk or on the phone.
"""


def all_faults(page: Page) -> list[str]:
    """Faults of a page in every size, light and dark."""
    faults = []
    for (width, height), schemes in zip(SIZES, SCHEMES, strict=True):
        page.set_viewport_size({"width": width, "height": height})
        for scheme in schemes:
            # without motion: colours must not be read in the middle of a transition
            page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
            page.wait_for_timeout(30)
            result = (layout_faults(page) if scheme == schemes[0] else {}) | text_faults(page)
            faults += [f"{width} {scheme}: {result}"] if result else []
            # axe takes longer than all else here: it looks once wide and once narrow, at contrast once
            if (width, scheme) in ((DESK_PX, "light"), (UPRIGHT_PX, "dark")):
                found_by_axe = axe_faults(page, contrast=scheme == "light")
                faults += [f"{width} {scheme}: axe {fault}" for fault in found_by_axe]
    return faults
