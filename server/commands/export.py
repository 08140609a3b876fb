"""`sagittal export`: convert the results of an analysis to another program's file format."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sagittal.core.errors import InputError, SagittalError
from sagittal.server.storage import fs


def export(
    folder: Path,
    /,
    *,
    kind: Annotated[str, Parameter(name="--as", metavar="FORMAT")],
    out: Path | None = None,
    code: str = "",
) -> int:
    """Write the results in `folder` in one format; 1 if not possible.

    Parameters
    ----------
    folder
        results of `sagittal analyse`
    kind
        xlsx, csv … (docs/reference/exports.md)
    out
        file to write (default: export-<format>.<extension> in that folder)
    code
        pseudonym of the subject, letters and digits
    """
    from sagittal.server.export.content import VisitFacts, open_content
    from sagittal.server.export.kinds import EXPORTED, find_kind, write_export
    from sagittal.server.provenance import CODE_VERSION
    from sagittal.server.viewer import recorded_walk  # noqa: F401 - registers what is drawn

    try:
        ending = find_kind(kind).ending
        if not (folder / "analysis.json").is_file():
            raise InputError(
                "no_results",
                f"{folder} holds no analysis.json; give the folder that `sagittal analyse` wrote.",
            )
        readers = {path.name: path.read_bytes for path in sorted(folder.glob("*")) if path.is_file()}
        content = open_content(
            readers, VisitFacts(subject=code or "anonymous", code=code, version=CODE_VERSION)
        )
        written = write_export(kind, content)
    except SagittalError as error:
        sys.stderr.write(f"No export ({error.code}): {error.message}\n")
        return 1
    target = folder / f"{EXPORTED}{kind}.{ending}" if out is None else out
    fs.make_folder(target.parent)
    fs.write_file(target, written)
    sys.stdout.write(f"Written: {target}\n")
    return 0
