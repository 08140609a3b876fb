"""Prepares charts for a print renderer, which does not apply the page's styles inside an `<svg>`.

On a page charts stretch with their column, strokes keep their width, and colours come from the design tokens
(server/report/charts/svg.py). Here each chart gets its width in px, its shapes are moved to it, the margins
become part of the figure, and the rules for charts go into it with their colours written out.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from sagittal.server.report.charts.paper_words import SVG, place_words

SHEET_PX: Final = 703
"""Width of a page between its margins (web/static/css/pdf.css): 210 mm minus 2 × 12 mm."""
WIDTHS_PX: Final = {"r-glance": 197, "r-bot": 120, "r-kin": 230, "r-map": 250, "r-trends": 342, "dayrow": 627}
"""Width of a chart by its container."""

LABEL_PX: Final = 12
"""Half of the widest label at the right end of an axis: content outside a chart is clipped."""

_RULE: Final = re.compile(r"([^{}]+)\{([^{}]*)\}")
_COMMENT: Final = re.compile(r"/\*.*?\*/", re.DOTALL)
_TOKEN: Final = re.compile(r"(--[\w-]+)\s*:\s*([^;]+);")
_LIGHT: Final = re.compile(r"light-dark\(\s*([^,()]+(?:\([^()]*\))?)\s*,[^()]*(?:\([^()]*\))?[^()]*\)")
_STEP: Final = re.compile(r"[A-Za-z]|[-+]?\d*\.?\d+")
_NOT_HERE: Final = ("vector-effect", "paint-order", "cursor", "font-variant-numeric")
"""Declarations unknown to the print renderer, which would warn about each."""


@dataclass(frozen=True)
class ChartStyles:
    """Chart-related part of style sheets.

    Parameters
    ----------
    rules : rules for elements within a chart, with colours resolved.
    margins : class of a chart → top, right, bottom, left in px.
    tokens : design tokens for print.
    """

    rules: str
    margins: Mapping[str, tuple[float, float, float, float]]
    tokens: Mapping[str, str]


def read_chart_styles(styles: str) -> ChartStyles:
    """Read the style sheets of a page."""
    plain = _COMMENT.sub("", styles)
    tokens = {name: _LIGHT.sub(r"\1", value).strip() for name, value in _TOKEN.findall(plain)}
    rules, margins = [], {}
    for selectors, body in _RULE.findall(plain):
        inside = [
            s.strip().removeprefix(".chart ") for s in selectors.split(",") if s.strip().startswith(".chart ")
        ]
        if inside and not any("halo" in s for s in inside):
            declarations = [d.strip() for d in body.split(";") if d.strip()]
            declarations = [d for d in declarations if d.split(":")[0] not in _NOT_HERE]
            rules.append(f"{', '.join(inside)} {{ {_write_out('; '.join(declarations), tokens)} }}")
        margin = re.search(r"padding:([^;]+)", body)
        if margin is not None and (chart := re.fullmatch(r"\.chart\.([\w-]+)", selectors.strip())):
            margins[chart[1]] = _read_margin(margin[1])
        padding = re.search(r"padding-bottom:\s*([\d.]+)px", body)
        if padding is not None and (chart := re.fullmatch(r"\.chart\.([\w-]+)\.([\w-]+)", selectors.strip())):
            top, right, _, left = margins[chart[1]]
            margins[chart[2]] = (top, right, float(padding[1]), left)
    return ChartStyles("\n".join(rules), margins, tokens)


def prepare_figures(page: Element, styles: ChartStyles) -> None:
    """Rewrite all charts in the tree of a page."""
    parents = {child: parent for parent in page.iter() for child in parent}
    symbols = {s.get("id"): s for s in page.iter(f"{SVG}symbol")}
    patterns = list(page.iter(f"{SVG}pattern"))
    for figure in [f for f in page.iter(f"{SVG}svg") if not parents[f].tag.startswith(SVG)]:
        ancestors = [figure]
        while ancestors[-1] in parents:
            ancestors.append(parents[ancestors[-1]])
        classes = [_classes(e) for e in ancestors]
        if classes[0] & {"sprite", "patterns"}:
            parents[figure].remove(figure)
            continue
        _inline_symbol(figure, symbols)
        badge = next((k for k in ("ok", "warn", "bad", "info") if {"badge", k} <= classes[1]), None)
        figure.set("color", styles.tokens[f"--{badge or 'ink'}"])
        for shape in figure.iter():
            if "cut" in _classes(shape):
                shape.set("stroke", styles.tokens[f"--{badge}-bg" if badge else "--surface"])
        if "chart" in classes[0] | classes[1]:
            _draw_chart(figure, classes, styles)
            if any(value.startswith("url(#") for shape in figure.iter() for value in shape.attrib.values()):
                # a copy: the renderer modifies its drawing
                SubElement(figure, f"{SVG}defs").extend(copy.deepcopy(patterns))


def _draw_chart(figure: Element, classes: list[set[str]], styles: ChartStyles) -> None:
    style = Element(f"{SVG}style")
    style.text = styles.rules
    if figure.get("width") == "100%":
        width = float(next((px for k, px in WIDTHS_PX.items() if any(k in c for c in classes)), SHEET_PX))
        own = [styles.margins[k] for k in styles.margins if k in classes[1] | classes[0]]
        top, right, bottom, left = own[-1] if own else (0.0, 0.0, 0.0, 0.0)
        right = max(right, LABEL_PX) if own else right
        plot, height = width - left - right, float(figure.get("height", "0"))
        _fix_size(figure, plot, height)
        if "cycle" in classes[1]:
            place_words(figure, plot, height, left)
        figure.set("width", f"{width:g}")
        figure.set("height", f"{height + top + bottom:g}")
        figure.set("viewBox", f"{-left:g} {-top:g} {width:g} {height + top + bottom:g}")
    figure.set("font-family", styles.tokens["--font"])
    figure.set("font-size", "11")
    figure.insert(0, style)


def _fix_size(figure: Element, width: float, height: float) -> None:
    """Convert relative sizes and positions of a plot area to px."""
    for part in list(figure):
        if part.get("hidden") is not None or "cursor" in _classes(part):
            figure.remove(part)
        elif part.get("preserveAspectRatio") == "none":
            scale = (width / 1000.0, height / 1000.0)
            del part.attrib["preserveAspectRatio"], part.attrib["viewBox"]
            part.set("width", f"{width:g}")
            part.set("height", f"{height:g}")
            _stretch(part, *scale)
        else:
            for name in ("x", "x1", "x2", "width"):
                if (share := part.get(name, "")).endswith("%"):
                    part.set(name, f"{float(share[:-1]) / 100.0 * width:.2f}")


def _stretch(group: Element, x: float, y: float) -> None:
    for shape in list(group):
        if shape.get("hidden") is not None or "cursor" in _classes(shape):
            group.remove(shape)
            continue
        for names, scale in ((("x", "x1", "x2", "width", "cx"), x), (("y", "y1", "y2", "height", "cy"), y)):
            for name in names:
                if name in shape.attrib:
                    shape.set(name, f"{float(shape.attrib[name]) * scale:.2f}")
        if "points" in shape.attrib:
            numbers = [float(n) for n in re.split(r"[\s,]+", shape.attrib["points"].strip())]
            shape.set("points", " ".join(f"{n * (y if i % 2 else x):.2f}" for i, n in enumerate(numbers)))
        if "d" in shape.attrib:
            shape.set("d", stretch_path(shape.attrib["d"], x, y))
        _stretch(shape, x, y)


def stretch_path(path: str, x: float, y: float) -> str:
    """Scale a path of straight lines (M L H V, lower case too, Z) along each axis.

    >>> stretch_path("M0 500l20-10H40v5z", 0.5, 2.0)
    'M 0.00 1000.00 l 10.00 -20.00 H 20.00 v 10.00 z'
    """
    command, count, tokens = "", 0, []
    for step in _STEP.findall(path):
        if step.isalpha():
            command, count = step.upper(), 0
            tokens.append(step)
            continue
        along = command == "H" or (command != "V" and count % 2 == 0)
        tokens.append(f"{float(step) * (x if along else y):.2f}")
        count += 1
    return " ".join(tokens)


def _inline_symbol(figure: Element, symbols: Mapping[str | None, Element]) -> None:
    for use in [u for u in figure if u.tag == f"{SVG}use"]:
        symbol = symbols.get(use.get("href", "").removeprefix("#"))
        figure.remove(use)
        if symbol is not None:
            figure.set("viewBox", symbol.get("viewBox", "0 0 20 20"))
            group = SubElement(figure, f"{SVG}g")
            group.extend(list(symbol))


def _classes(element: Element) -> set[str]:
    return set(element.get("class", "").split())


def _write_out(text: str, tokens: Mapping[str, str]) -> str:
    while (match := re.search(r"var\((--[\w-]+)\)", text)) is not None:
        text = text.replace(match[0], tokens.get(match[1], "inherit"))
    return text


def _read_margin(text: str) -> tuple[float, float, float, float]:
    """Parse the four lengths of a `padding` in px."""
    lengths = [float(n.removesuffix("px")) for n in text.split() if re.fullmatch(r"[\d.]+(px)?", n)]
    top = lengths[0] if lengths else 0.0
    right = lengths[1] if len(lengths) > 1 else top
    bottom = lengths[2] if len(lengths) > 2 else top
    return top, right, bottom, lengths[3] if len(lengths) > 3 else right
