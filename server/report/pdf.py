"""PDF rendering of a self-contained document by WeasyPrint (BSD-3-Clause; needs the system's Pango).

Nothing is downloaded: styles are inline, images are `data:` URLs; other URLs are refused. Imported only in a
separate process (server/sharing/paper_child.py), as the library takes a second and 130 MB.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from sagittal.core.errors import SagittalError
from sagittal.server.report.charts.paper_charts import prepare_figures, read_chart_styles

STYLES: Final = Path(__file__).parents[2] / "web" / "static" / "css" / "pdf.css"

BLOCKS: Final = frozenset({"p", "li", "td", "th", "dt", "dd", "h1", "h2", "h3", "figcaption"})
"""Elements that contain lines of text."""

MISSING: Final = (
    "This server cannot create PDFs: WeasyPrint or the system library Pango is missing. Install "
    "'sagittal[pdf]' and libpango-1.0-0, libpangoft2-1.0-0; or print the page and choose PDF as the "
    "printer."
)


class PdfMissing(SagittalError):  # noqa: N818 - says what is missing
    """The library for PDFs is not installed."""

    status = 404

    def __init__(self) -> None:
        super().__init__("pdf_missing", MISSING)


def render_pdf(html: str) -> bytes:
    """Render a document; the same document gives the same bytes.

    Raises
    ------
    PdfMissing
    """
    try:
        from weasyprint import HTML
        from weasyprint.urls import URLFetcher
    except (ImportError, OSError) as error:  # OSError: Pango is not installed
        logging.getLogger(__name__).warning("no PDF can be made: %s", error)
        raise PdfMissing from error
    # it warns about every screen-only rule
    logging.getLogger("weasyprint").setLevel(logging.ERROR)
    logging.getLogger("weasyprint.progress").setLevel(logging.ERROR)
    document = HTML(string=html, url_fetcher=URLFetcher(allowed_protocols={"data"}))
    page: Element = document.etree_element
    styles = "".join(style.text or "" for style in page.iter("style"))
    prepare_figures(page, read_chart_styles(styles))
    _move_foot(page)
    _trim_ends(page)
    # the last one, so that it precedes those of the document
    SubElement(next(page.iter("head")), "style").text = STYLES.read_text("utf-8")
    content: bytes = document.write_pdf()
    return content


def _trim_ends(page: Element) -> None:
    """Remove white space at the end of blocks: otherwise a line that just fits breaks after its first
    word.
    """
    for block in page.iter():
        if block.tag in BLOCKS:
            if len(block):
                block[-1].tail = (block[-1].tail or "").rstrip()
            else:
                block.text = (block.text or "").rstrip()


def _move_foot(page: Element) -> None:
    """Move the first page's footer to the start, from where every page takes it; remove the others."""
    parents = {child: parent for parent in page.iter() for child in parent}
    feet = [e for e in page.iter("footer") if "r-foot" in e.get("class", "").split()]
    for foot in feet:
        parents[foot].remove(foot)
    if feet:
        body = next(page.iter("body"))
        body.insert(0, feet[0])
