"""`sagittal research`: de-identified results of patients for research, and who is behind a pseudonym."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sagittal.server.commands.options import DataDir
from sagittal.server.settings import load_settings


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
    """Write the zip, or name the patient behind a pseudonym; 1 when that is not possible.

    Parameters
    ----------
    out
        the file to write
    key
        leads pseudonyms back; made anew where there is none
    patients
        these only (default: all)
    signals
        also what the sensors measured
    without_consent
        also who has not agreed to research
    who
        say whose pseudonym of this key it is; nothing is written
    """
    from sagittal.core.errors import SagittalError
    from sagittal.server.downloads import deidentified
    from sagittal.server.storage import fs
    from sagittal.server.storage.db import Database
    from sagittal.server.storage.files.blob_opening import open_blobs
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
            with db.read() as c:
                if who is not None:
                    found = deidentified.find_person(c, secret, who)
                    sys.stdout.write(f"{who} is {found.code}\n" if found else f"{who} is nobody here\n")
                    return 0 if found else 1
                asked = deidentified.list_chosen(c, patients)
                chosen = [p for p in asked if without_consent or deidentified.has_agreed(c, p.id)]
            if not chosen:
                raise SagittalError("nobody", "None of them has agreed to research; see --without-consent.")
            target = (out or Path()).absolute()
            fs.make_folder(target.parent)
            with fs.IncomingFile(target.parent) as incoming:
                for piece in deidentified.export_deidentified(
                    db, open_blobs(settings), secret, chosen, with_signals=signals
                ):
                    incoming.write(piece)
                incoming.keep(target)
    except (MigrationError, SagittalError) as error:
        sys.stderr.write(f"{error}\n")
        return 1
    if is_new:
        sys.stdout.write(f"{key} is a new key: who has it can lead pseudonyms back. Keep it in the clinic.\n")
    sys.stdout.write(
        f"Written: {target}, {len(chosen)} patients; {len(asked) - len(chosen)} have not agreed.\n"
    )
    sys.stdout.flush()
    return 0
