"""viser servers accessible only to this process: they listen on Unix sockets in private folders.

viser checks neither cookies nor origins and normally listens on TCP, where any user of the machine and any
page in a local browser could connect. A socket file in a private folder prevents both.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from pathlib import Path
from typing import Final

import rich
import viser

from sagittal.core.errors import EstimationError
from sagittal.server.viewer.viser_adapter import forbid_sharing

LONGEST_PATH_BYTES: Final = 100
"""A socket path has at most 108 bytes on Linux, 104 elsewhere; viser waits forever for a longer one."""


def start_scene_server() -> viser.ViserServer:
    """Start a viser server in a new folder accessible only to this user.

    Raises
    ------
    EstimationError
        `no_place_for_views`: the folder for temporary files cannot be written, or its path is too long.
    """
    # viser prints a banner per server even if not verbose
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
    forbid_sharing(server)
    return server


def socket_of(server: viser.ViserServer) -> Path:
    """Socket of a scene server."""
    return Path(server.get_host())


def stop_scene_server(server: viser.ViserServer) -> None:
    """Stop a scene server and remove its folder."""
    server.stop()
    # temporary files may have been cleaned up
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(socket_of(server).parent)


def _no_place(reason: str) -> EstimationError:
    return EstimationError(
        "no_place_for_views",
        f"The server cannot keep 3D views in its folder for temporary files ({reason}); "
        "an administrator can set TMPDIR to another.",
    )
