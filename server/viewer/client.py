"""Viser's client page: one cacheable document for all views.

In viser's own page the script is already compressed and cannot be compressed further. For clients that accept
brotli (browsers do over TLS and on localhost) script and style are unpacked and the whole page is compressed:
0.63 MB instead of 0.67. This takes seconds once per version; meanwhile the original is served.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import os
import re
import threading
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np

from sagittal.server.storage import fs
from sagittal.server.storage.compile_cache import VARIABLE
from sagittal.server.viewer.viser_adapter import read_client

log = logging.getLogger(__name__)

QUALITY: Final = 10
"""Brotli quality: 9 compresses 7 % less, 11 takes twice the time for 2 %."""

_HIDE_PANEL = "<style>.mantine-Paper-root,.mantine-Notifications-root{display:none!important}</style>"
_BEGIN = """<script>{
  const [view, dark] = location.hash.slice(1).split(",");
  history.replaceState(null, "", `/views/${view}/${dark ? "?darkMode" : ""}`);
  const tell = (what) => parent.postMessage(what, location.origin);
  const open = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    const context = open.call(this, kind, ...more);
    if (kind !== "webgl2") return context;
    if (!context) tell("no-3d");
    else context.drawElementsInstanced = function (...all) {
      delete context.drawElementsInstanced;
      requestAnimationFrame(() => requestAnimationFrame(() => tell("drawn")));
      return context.drawElementsInstanced(...all);
    };
    return context;
  };
}</script>"""
"""Inserted before viser's scripts. The page is the same for all views; its client connects to the relay at
its address and is dark from the start if the hash requests it. Of all instanced meshes (batches.py) the
avatar is first.
"""

_QUIET = """<script>{
  const load = window.fetch;
  window.fetch = (what, ...more) =>
    String(what).startsWith("data:application/wasm") ? new Promise(() => {}) : load(what, ...more);
  const warn = console.warn;
  console.warn = (...all) => String(all[0]).startsWith("THREE.Clock:") || warn(...all);
}</script>"""
"""Inserted before viser's scripts: disables features not needed here that would log errors or warnings. The
client loads a WebAssembly module that sorts Gaussian splats, whose bindings (Emscripten's embind) call
`Function` on strings. We show no splats: the module is never loaded, so the page's policy need not allow
`unsafe-eval`. The deprecation of `THREE.Clock` concerns viser's developers only.
"""

_PACKED = re.compile(r'<script data-p="([^"]*)" data-ss="(\d+)" data-cs="(\d+)">')
_BOOT = re.compile(
    r'const A="(?P<digits>[^"]+)";.*await init\(\);'
    r"(?P<unpack>  const a=de\(d\.p\);.*?free\(up\);)\}\)\(\);</script>",
    re.DOTALL,
)
_RUN = (
    "const run=()=>{const e=document.createElement('script');e.type='module';"
    "e.textContent=document.getElementById('client').textContent;document.head.appendChild(e)};"
    "if(document.readyState==='loading')document.addEventListener('DOMContentLoaded',run);else run();"
)

_packing = threading.Lock()


@functools.cache
def client_page() -> str:
    """Viser's client page from its wheel, without the control panel, which has no option to hide it."""
    return _add_to_head(read_client(), _BEGIN + _QUIET, _HIDE_PANEL)


def silence(page: str) -> str:
    """Modify viser's client page so that it does not log messages about unused features."""
    return _add_to_head(page, _QUIET, "")


def _add_to_head(page: str, first: str, last: str) -> str:
    start, opened, tail = page.partition("<head>")
    head, closed, body = tail.partition("</head>")
    return f"{start}{opened}{first}{head}{last}{closed}{body}"


@functools.cache
def client_version() -> str:
    """Version in the URL of the client page, which changes with its content."""
    return hashlib.sha256(client_page().encode()).hexdigest()[:16]


def unpack_page(page: str) -> str | None:
    """The page with uncompressed style and script; None if viser's packing is unknown."""
    import pyarrow as pa  # slow import

    packed, boot = _PACKED.search(page), _BOOT.search(page)
    if packed is None or boot is None:
        return None
    style, script = int(packed[2]), int(packed[3])
    frame = _read_digits(packed[1], boot["digits"].replace("\\\\", "\\"))
    try:
        plain = pa.decompress(frame, style + script, codec="zstd", asbytes=True)
        css, code = plain[:style].decode(), plain[style:].decode()
    except (OSError, UnicodeDecodeError):
        return None
    if re.search(r"</script|<!--", code, re.IGNORECASE) or "</style" in css.lower():
        return None
    page = page[: boot.start("unpack")] + _RUN + page[boot.end("unpack") :]
    inert = f'<style>{css}</style><script type="text/plain" id="client">{code}</script><script>'
    return page[: packed.start()] + inert + page[packed.end() :]


def find_packed_page() -> bytes | None:
    """The unpacked page as brotli; None while it is being created, which the first call starts."""
    folder = os.environ.get(VARIABLE)
    if not folder:
        return None
    file = Path(folder) / f"viewer-{client_version()}.br"
    with suppress(OSError):
        return file.read_bytes()
    if _packing.acquire(blocking=False):
        threading.Thread(target=_pack, args=(file,), name="pack viser's page", daemon=True).start()
    return None


def _pack(file: Path) -> None:
    """Write the compressed page; a failure is retried at the next start of the server."""
    import brotli

    page = unpack_page(client_page())
    if page is None:
        log.warning("viser's client page is packed in an unknown way; it is served as it is.")
        return
    try:
        fs.make_folder(file.parent)
        fs.write_file(file, brotli.compress(page.encode(), quality=QUALITY))
    except OSError as error:
        log.warning("The packed page of the 3D view could not be kept: %s", error)


def _read_digits(text: str, digits: str) -> bytes:
    """Decode base-N text: each five digits, most significant first, are four bytes."""
    value = np.zeros(128, np.int64)
    value[[ord(c) for c in digits]] = np.arange(len(digits))
    values = value[np.frombuffer(text.encode("ascii"), np.uint8)]
    whole = len(values) // 5
    powers = len(digits) ** np.arange(4, -1, -1, dtype=np.int64)
    start = (values[: 5 * whole].reshape(-1, 5) @ powers).astype(">u4").tobytes()
    remainder = 0
    for digit in values[5 * whole :]:
        remainder = remainder * len(digits) + int(digit)
    return start + remainder.to_bytes(8, "big")[8 - max(len(values) % 5 - 1, 0) :]
