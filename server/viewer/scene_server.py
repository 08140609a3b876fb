"""viser servers that only this process can reach: they listen on Unix sockets in folders of their own.

viser asks neither for a cookie nor where a page comes from, and listens on TCP, where every user of the
machine and every page in a browser on it can knock. A socket file in its owner's folder has neither door.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import rich
import viser
import websockets.asyncio.server
from viser._messages import ShareUrlRequest
from viser.infra import _infra

from sagittal.core.errors import EstimationError

LONGEST_PATH_BYTES: Final = 100
"""A socket's path has at most 108 bytes on Linux, 104 elsewhere; viser waits for ever for a longer one."""


def start_scene_server() -> viser.ViserServer:
    """Start a viser server in a new folder that only this user may enter.

    Raises
    ------
    EstimationError
        `no_place_for_views`: the folder for temporary files cannot be written, or its path is too long.
    """
    # viser prints a banner per server even when told not to be verbose
    rich.get_console().quiet = True
    try:
        folder = Path(tempfile.mkdtemp(prefix="sagittal-view-"))
    except OSError as error:
        raise _no_place(error.strerror or str(error)) from None
    path = folder / "viser"
    if len(str(path).encode()) > LONGEST_PATH_BYTES:
        folder.rmdir()
        raise _no_place("its path is too long")
    server = viser.ViserServer(host=str(path), port=0, verbose=False)
    # a client could ask for a public tunnel through a third party; the proxy drops the request, this one too
    server._websock_server.unregister_handler(ShareUrlRequest)  # noqa: SLF001
    return server


def socket_of(server: viser.ViserServer) -> Path:
    """The socket that a scene server listens on."""
    return Path(server.get_host())


def stop_scene_server(server: viser.ViserServer) -> None:
    """Stop a scene server and remove its folder."""
    server.stop()
    # what cleans temporary files may have been here before
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(socket_of(server).parent)


def _no_place(why: str) -> EstimationError:
    return EstimationError(
        "no_place_for_views",
        f"The server cannot keep 3D views in its folder for temporary files ({why}); "
        "an administrator can set TMPDIR to another.",
    )


def _serve(handler: Any, host: str, port: int, **options: Any) -> Any:
    """Listen as viser asks to, on a Unix socket if the host is a path."""
    if host.startswith("/"):
        return websockets.asyncio.server.unix_serve(handler, host, **options)
    return websockets.asyncio.server.serve(handler, host, port, **options)


# viser has no way to say where it listens but host and port: we give its own module, and no other, a `serve`
# that knows paths (tests/server/viewer/test_viser_contract.py tells when a new version needs another)
_infra.websockets = SimpleNamespace(
    asyncio=SimpleNamespace(server=SimpleNamespace(serve=_serve)),
    datastructures=websockets.datastructures,
    exceptions=websockets.exceptions,
)
