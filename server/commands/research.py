"""`sagittal research`: export de-identified results for research, or identify a pseudonym."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import Settings, load_settings

if TYPE_CHECKING:
    from sagittal.server.clinic.patients import Patient
    from sagittal.server.downloads.deidentified import ResearchKey
    from sagittal.server.storage.db import Database


def research(
    out: Annotated[Path | None, Parameter(metavar="ZIP")] = None,
    /,
    *,
    key: Path,
    patients: Annotated[tuple[str, ...], Parameter(metavar="CODE ...")] = (),
    signals: bool = False,
    without_consent: bool = False,
    who: Annotated[str | None, Parameter(metavar="PSEUDONYM")] = None,
    data_dir: DataDir = None,
) -> int:
    """Write the zip, or name the patient with a pseudonym; 1 if not possible.

    Parameters
    ----------
    out
        the file to write
    key
        key of the pseudonyms; created if it does not exist
    patients
        only these patients (default: all)
    signals
        include sensor signals
    without_consent
        include patients without consent to research
    who
        print the patient with this pseudonym; nothing is written
    """
    from sagittal.core.errors import SagittalError
    from sagittal.server.downloads import deidentified
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.migrate import MigrationError, require_current

    settings = load_settings({"data_dir": data_dir})
    try:
        require_current(settings.database_source)
        if out is None and who is None:
            raise SagittalError("nothing_asked", "Name the zip to write, or a pseudonym with --who.")
        is_new = not key.exists()
        if who is not None and is_new:
            raise SagittalError("no_key", f"{key} is not there; give the key of the pseudonym.")
        secret = deidentified.open_key(key)
        with closing(Database(settings.database_source)) as db:
            if who is not None:
                return _name_person(db, secret, who)
            chosen, requested = _choose(db, patients, without_consent)
            target = (out or Path()).absolute()
            _write_zip(target, settings, db, secret, chosen, signals)
    except (MigrationError, SagittalError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    if is_new:
        sys.stdout.write(f"{key} is a new key: who has it can lead pseudonyms back. Keep it in the clinic.\n")
    sys.stdout.write(
        f"Written: {target}, {len(chosen)} patients; {requested - len(chosen)} have not agreed.\n"
    )
    sys.stdout.flush()
    return 0


def _name_person(db: Database, secret: ResearchKey, pseudonym: str) -> int:
    """Print the patient with a pseudonym; 1 if unknown."""
    from sagittal.server.downloads import deidentified

    with db.read() as c:
        person = deidentified.find_person(c, secret, pseudonym)
    sys.stdout.write(f"{pseudonym} is {person.code}\n" if person else f"{pseudonym} is nobody here\n")
    return 0 if person else 1


def _choose(db: Database, codes: tuple[str, ...], without_consent: bool) -> tuple[list[Patient], int]:
    """Patients to export, and the number requested."""
    from sagittal.core.errors import SagittalError
    from sagittal.server.downloads import deidentified

    with db.read() as c:
        requested = deidentified.list_chosen(c, codes)
        chosen = [p for p in requested if without_consent or deidentified.has_agreed(c, p.id)]
    if not chosen:
        raise SagittalError("nobody", "None of them has agreed to research; see --without-consent.")
    return chosen, len(requested)


def _write_zip(
    target: Path,
    settings: Settings,
    db: Database,
    secret: ResearchKey,
    chosen: Sequence[Patient],
    signals: bool,
) -> None:
    """Write the file under a temporary name and rename it when complete."""
    from sagittal.server.downloads import deidentified
    from sagittal.server.storage import fs
    from sagittal.server.storage.files.blob_opening import open_blobs

    fs.make_folder(target.parent)
    with fs.IncomingFile(target.parent) as incoming:
        for piece in deidentified.export_deidentified(
            db, open_blobs(settings), secret, chosen, with_signals=signals
        ):
            incoming.write(piece)
        incoming.keep(target)
