"""The console script `sagittal`: one function in server/commands per command, its signature the options.

Exit codes: 0 = success (analyse: at least one parameter), 1 = failure (analyse: nothing analysable), 2 =
invalid arguments.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Final

from cyclopts import App, CycloptsError, Parameter

from sagittal import __version__

COMMANDS: Final = {
    "serve": "Run the web server and its workers.",
    "worker": "Run one worker on the data folder of a server, on another computer too.",
    "demo": "Run a temporary clinic with simulated patients; nothing is kept.",
    "analyse": "Analyse recording files and write the results into a folder.",
    "export": "Write the results of an analysis for another program (docs/reference/exports.md).",
    "study": "Analyse every recording of a folder: one table of strides and one of takes.",
    "stairs": "Measure a person's own limits of stairs in daily life (docs/science/activity.md).",
    "replay": "Stream a recording to a server as a tablet would (docs/reference/live-protocol.md).",
    "simulate": "Write a simulated recording and its exact truth.",
    "bench": "Score published algorithms on recordings with a reference, or list them.",
    "sensitivity": "Say how far angles of a squat move with each measure and each sensor.",
    "tune": "Fit the gains of a filter to recordings with a reference; others judge them.",
    "check": "Check database, stored files by their hash, live logs, trash, audit chain, encrypted values.",
    "backup": "Write database, stored files and live logs into one file, while the service runs.",
    "restore": "Put a backup into an empty data folder, after checking all of it.",
    "keygen": "Make a key for encrypted backups.",
    "identity-key": "Make or change the key that encrypts patients' names; make it to keep names.",
    "trash": "List stored files that the database does not know; they stay 30 days.",
    "research": "Write de-identified results of patients into a zip for research.",
    "adopt": "List live recordings that the database does not know, or give one to a session.",
    "accept": "Go on with this database, though it was emptied, put back or exchanged.",
    "migrate": "Bring the database to the schema of this version (after a backup).",
    "move-database": "Move the database from the data folder's file to PostgreSQL.",
    "move-blobs": "Move stored files from the data folder into SAGITTAL_BUCKET.",
    "warm": "Compile the filters now, so that the first analysis does not wait for it.",
    "user": "Add a user, or give one a new password, on the command line.",
}
"""Command → description for `sagittal --help`, without importing it."""

SCIENCE: Final = frozenset({"bench", "sensitivity", "simulate", "stairs", "study", "tune"})
"""Commands whose module is in server/commands/science."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    from sagittal.server.processes.memory import share_allocator

    share_allocator()
    words = sys.argv[1:] if argv is None else list(argv)
    try:
        if not words:
            raise CycloptsError(msg="A command is missing.")
        run, bound, _ = make_app().parse_args(words, print_error=False, exit_on_error=False)
    except CycloptsError as error:
        command = f"{words[0]} " if words and words[0] in COMMANDS else ""
        sys.stderr.write(
            f"{str(error).strip().rstrip('.')}. `sagittal {command}--help` says what is possible.\n"
        )
        return 2
    if words[0] not in COMMANDS or run.__module__.startswith("cyclopts"):
        run(*bound.args, **bound.kwargs)  # help or version
        return 0
    from sagittal.core.errors import SagittalError
    from sagittal.server.settings import SettingsError, load_settings
    from sagittal.server.storage.compile_cache import share_compile_cache

    try:
        # before numba, which no command loads before it runs
        share_compile_cache(load_settings({"data_dir": bound.arguments.get("data_dir")}).cache)
        return int(run(*bound.args, **bound.kwargs))
    except SettingsError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    except OSError as error:
        if error.filename is None:
            raise  # without a file: cannot be fixed by its name
        sys.stderr.write(f"{error.filename}: {error.strerror}. Check the path, its rights and the disk.\n")
        return 1
    except SagittalError as error:
        detail = getattr(error, "detail", "")
        sys.stderr.write(f"{error.message}{f' ({detail})' if detail else ''}\n")
        return 1
    except KeyboardInterrupt:
        return 130


def make_app() -> App:
    """Command-line application; each command is imported when called, as numba and the web stack load
    slowly.
    """
    app = App(
        name="sagittal",
        help="Gait analysis from body-worn IMUs. Not a medical device.",
        version=f"sagittal {__version__}",
        version_flags=["--version"],
        help_format="plaintext",
        help_formatter="plain",
        default_parameter=Parameter(consume_multiple=True, negative=(), show_default=False),
    )
    for name, text in COMMANDS.items():
        app.command(f"{find_module(name)}:{name.replace('-', '_')}", name=name, help=text)
    return app


def find_module(command: str) -> str:
    """Name of the module of a command, whose function has the same name."""
    room = "commands.science" if command in SCIENCE else "commands"
    return f"sagittal.server.{room}.{command.replace('-', '_')}"


if __name__ == "__main__":
    sys.exit(main())
