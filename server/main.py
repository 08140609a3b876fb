"""The console script `sagittal`: one parser, one module of server/commands per command.

Exit codes: 0 = done (analyse: at least one parameter), 1 = not possible (analyse: nothing analysable), 2 =
the call's words are off.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    arguments = vars(_parser().parse_args(argv))
    command = arguments.pop("command")
    return int(_run(command, arguments))


def _run(command: str, given: dict[str, object]) -> int:
    # numba and the web stack take seconds to import: each command loads only what it needs
    from importlib import import_module

    from sagittal.core.errors import SagittalError
    from sagittal.server.processes.memory import share_allocator
    from sagittal.server.settings import SettingsError, load_settings
    from sagittal.server.storage.compile_cache import share_compile_cache

    share_allocator()
    try:
        share_compile_cache(load_settings({"data_dir": given.get("data_dir")}).cache)
        name = command.replace("-", "_")
        run = getattr(import_module(f"sagittal.server.commands.{name}"), name)
        return int(run(**given))
    except SettingsError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    except OSError as error:
        if error.filename is None:
            raise  # of no file: nothing that a person could put right by its name
        sys.stderr.write(f"{error.filename}: {error.strerror}. Check the path, its rights and the disk.\n")
        return 1
    except SagittalError as error:
        detail = getattr(error, "detail", "")
        sys.stderr.write(f"{error.message}{f' ({detail})' if detail else ''}\n")
        return 1
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="sagittal", description="Gait analysis from body-worn IMUs. Not a medical device."
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, text: str) -> argparse.ArgumentParser:
        return commands.add_parser(name, help=text, description=text)

    p = add("serve", "Run the web server and its workers.")
    _server_options(p)
    p.add_argument("--workers", type=int, help="worker processes (default 1)")
    _data_option(add("worker", "Run one worker on the data folder of a server, on another computer too."))
    p = add("demo", "Run a temporary clinic with simulated patients; nothing is kept.")
    p.add_argument("--port", type=int, default=None, help="port on 127.0.0.1 (default: a free one)")
    p = add("analyse", "Analyse recording files and write the results into a folder.")
    p.add_argument("paths", nargs="+", type=Path, metavar="PATH", help="files, folders or zips of one take")
    p.add_argument(
        "--manifest", type=Path, help="JSON: which sensor sits where, units (docs/reference/formats.md)"
    )
    p.add_argument("--out", type=Path, required=True, help="folder for the results")
    p.add_argument(
        "--estimator",
        default="auto",
        help="pose estimator; auto = the best for the sensors worn (docs/reference/estimators.md lists them)",
    )
    p.add_argument("--config", type=Path, help='JSON: parameters by stage, {"poses": {"least_valid": 0.7}}')
    p = add("export", "Write the results of an analysis for another program (docs/reference/exports.md).")
    p.add_argument("folder", type=Path, metavar="DIR", help="results of `sagittal analyse`")
    p.add_argument(
        "--as", dest="kind", required=True, metavar="FORMAT", help="xlsx, csv … (docs/reference/exports.md)"
    )
    p.add_argument("--out", type=Path, metavar="FILE", help="default: export-<format>.<ending> there")
    p.add_argument("--code", default="", help="pseudonym of the person, letters and digits")
    p = add("study", "Analyse every recording of a folder: one table of strides and one of takes.")
    p.add_argument("folder", type=Path, metavar="DIR", help="recordings in any layout, BIDS too")
    p.add_argument("--out", type=Path, required=True, help="folder for the tables; run again, it goes on")
    p.add_argument("--config", type=Path, help="JSON: parameters by stage, for every take")
    p.add_argument("--jobs", type=int, metavar="N", help="takes at a time (default: one per processor)")
    p = add("stairs", "Measure a person's own limits of stairs in daily life (docs/science/activity.md).")
    p.add_argument("paths", nargs="+", type=Path, metavar="PATH", help="files, folders or zips of one take")
    p.add_argument(
        "--manifest", type=Path, help="JSON: which sensor sits where, units (docs/reference/formats.md)"
    )
    for name, what in (("level", "on the level"), ("up", "upstairs"), ("down", "downstairs")):
        p.add_argument(
            f"--{name}",
            nargs=2,
            type=float,
            required=True,
            metavar=("FROM", "TO"),
            help=f"when they walked {what}, s from the first sample",
        )
    p.add_argument("--out", type=Path, required=True, help="JSON file for `analyse --config`")
    p = add("replay", "Stream a recording to a server as a tablet would (docs/reference/live-protocol.md).")
    p.add_argument("paths", nargs="+", type=Path, metavar="PATH", help="files, folders or zips of one take")
    p.add_argument("--to", required=True, metavar="URL", help="address of the server, http://host:port")
    p.add_argument("--code", required=True, help="the code that the session's live page shows")
    p.add_argument(
        "--manifest", type=Path, help="JSON: which sensor sits where, units (docs/reference/formats.md)"
    )
    p.add_argument("--speed", type=float, default=1.0, help="1 = as recorded (default), 0 = at once")
    p.add_argument(
        "--drop", type=float, default=0.0, metavar="P", help="cut the connection, chance per batch"
    )
    p.add_argument("--jitter", type=float, default=0.0, metavar="MS", help="delay batches by up to this")
    p.add_argument("--batch", type=int, default=10, metavar="N", help="samples in a batch (default 10)")
    p = add("simulate", "Write a simulated recording and its exact truth.")
    p.add_argument("--out", type=Path, required=True, help="folder for recording and truth")
    p.add_argument(
        "--script",
        default="comfortable",
        help="comfortable, fast_with_turns, hemiparetic, squats, activity … (docs/science/simulation.md)",
    )
    p.add_argument("--seed", type=_whole, default=1)
    p.add_argument("--hours", type=float, default=24.0, help="of daily life, --script activity (default 24)")
    p = add("bench", "Score published algorithms on recordings with a reference, or list them.")
    p.add_argument("what", choices=("fusion",), help="fusion: orientation filters of one sensor")
    p.add_argument("folder", nargs="?", type=Path, metavar="DIR", help="recordings (docs/science/filters.md)")
    p.add_argument("--list", dest="show_list", action="store_true", help="list them, with their sources")
    p.add_argument("--out", type=Path, metavar="CSV", help="write every score into a file")
    p.add_argument("--every", action="store_true", help="print every recording instead of their mean")
    p = add("sensitivity", "Say how far angles of a squat move with each measure and each sensor.")
    p.add_argument(
        "paths", nargs="*", type=Path, metavar="PATH", help="files of one take (default: a simulated one)"
    )
    p.add_argument(
        "--reference", type=Path, help="angles.parquet to hold the angles against (default: themselves)"
    )
    p.add_argument(
        "--manifest", type=Path, help="JSON: which sensor sits where, units (docs/reference/formats.md)"
    )
    p.add_argument("--table-top", type=Path, metavar="PATH", help="take in which sensors left the table")
    p.add_argument("--side", choices=("left", "right"), help="leg that squats (default: all with sensors)")
    p.add_argument("--measures", type=Path, help="JSON: lengths in m (docs/science/squat.md)")
    p.add_argument("--from-standing", action="store_true", help="compare angles from standing")
    p.add_argument("--out", type=Path, metavar="CSV", help="write every figure into a file")
    p.add_argument("--seed", type=_whole, default=1, help="of the simulated take")
    p = add("tune", "Fit the gains of a filter to recordings with a reference; others judge them.")
    p.add_argument("folder", type=Path, metavar="DIR", help="recordings (docs/science/filters.md)")
    p.add_argument("--algorithm", required=True, help="of `sagittal bench fusion --list`")
    p.add_argument(
        "--validate",
        dest="validation",
        nargs="+",
        required=True,
        metavar="NAME",
        help="recordings that only judge, without .npz",
    )
    p.add_argument("--out", type=Path, default=Path("tuned.json"), metavar="JSON", help="default tuned.json")
    p.add_argument("--resume", type=Path, metavar="FILE", help="go on from the checkpoint of a stopped run")
    p.add_argument(
        "--scheme",
        choices=("fixed", "two_levels", "three_levels"),
        help="how gains follow the motion (default: as the algorithm's own)",
    )
    p.add_argument("--magnetometer", action=argparse.BooleanOptionalAction, help="default: where it can")
    p.add_argument("--seed", type=_whole, default=0)
    for name in ("particles", "iterations", "rounds", "random-rounds"):
        p.add_argument(f"--{name}", type=int, metavar="N", help="of the swarm (default: the thesis')")
    p = add(
        "check",
        "Check database, stored files by their hash, live logs, trash, audit chain, encrypted values.",
    )
    _data_option(p)
    p.add_argument("--head", type=Path, metavar="JSON", help="newest audit row as it was, kept elsewhere")
    p = add("backup", "Write database, stored files and live logs into one file, while the service runs.")
    _data_option(p)
    p.add_argument("target", type=Path, metavar="DIR|FILE", help="a folder of backups, or the file to write")
    p.add_argument("--key", type=Path, metavar="FILE", help="encrypt it (`sagittal keygen`)")
    p.add_argument(
        "--prune", action="store_true", help="then keep 7 days, 4 weeks and 12 months of that folder"
    )
    p = add("restore", "Put a backup into an empty data folder, after checking all of it.")
    _data_option(p)
    p.add_argument("archive", type=Path, metavar="FILE")
    p.add_argument("--key", type=Path, metavar="FILE", help="the private key of an encrypted backup")
    p.add_argument("--erased", type=Path, metavar="JSON", help="another list of who must not come back")
    p.add_argument("--test", action="store_true", help="only try it, in a folder that is removed again")
    p = add("keygen", "Make a key for encrypted backups.")
    p.add_argument("path", type=Path, metavar="FILE")
    p = add("identity-key", "Make or change the key that encrypts patients' names; make it to keep names.")
    p.add_argument("what", choices=("make", "change", "discard"), help="discard: list what it does not open")
    _data_option(p)
    p.add_argument("--really", action="store_true", help="remove what `discard` lists, for good")
    p.add_argument("--without-key", action="store_true", help="though the key is not there: lost for good")
    p = add("trash", "List stored files that the database does not know; they stay 30 days.")
    _data_option(p)
    p.add_argument("--restore", action="store_true", help="put back those that the database refers to")
    p = add("research", "Write de-identified results of patients into a zip for research.")
    _data_option(p)
    p.add_argument("out", nargs="?", type=Path, metavar="ZIP", help="the file to write")
    p.add_argument("--key", type=Path, required=True, metavar="FILE", help="leads pseudonyms back; made anew")
    p.add_argument("--patients", nargs="+", default=(), metavar="CODE", help="these only (default: all)")
    p.add_argument("--signals", action="store_true", help="also what the sensors measured")
    p.add_argument("--without-consent", action="store_true", help="also who has not agreed to research")
    p.add_argument("--who", metavar="PSEUDONYM", help="say whose pseudonym of this key it is")
    p = add("adopt", "List live recordings that the database does not know, or give one to a session.")
    _data_option(p)
    p.add_argument("take", nargs="?", help="one of the list")
    p.add_argument("--session", metavar="ADDRESS", help="the session's page, or its id")
    _data_option(add("accept", "Go on with this database, though it was emptied, put back or exchanged."))
    _data_option(add("migrate", "Bring the database to the schema of this version (after a backup)."))
    _data_option(add("move-database", "Move the database from the data folder's file to PostgreSQL."))
    _data_option(add("move-blobs", "Move stored files from the data folder into SAGITTAL_BUCKET."))
    add("warm", "Compile the filters now, so that the first analysis does not wait for it.")
    p = add("user", "Add a user, or give one a new password, on the command line.")
    _data_option(p)
    p.add_argument("name")
    p.add_argument("--role", default="clinician", choices=("admin", "clinician", "assistant", "viewer"))
    return parser


def _whole(text: str) -> int:
    """A seed: generators take none below zero."""
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number of 0 or more")
    return int(text)


def _data_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--data", dest="data_dir", type=Path, help="data folder (default: SAGITTAL_HOME, else ~/.sagittal)"
    )


def _server_options(parser: argparse.ArgumentParser) -> None:
    _data_option(parser)
    parser.add_argument("--host", help="address to listen on (default 127.0.0.1)")
    parser.add_argument("--port", type=int, help="port to listen on (default 8000)")


def _version() -> str:
    try:
        return f"sagittal {version('sagittal')}"
    except PackageNotFoundError:
        return "sagittal (source tree)"


if __name__ == "__main__":
    sys.exit(main())
