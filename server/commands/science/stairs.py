"""`sagittal stairs`: individual stair limits, as overrides for `sagittal analyse --config`."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sagittal.core.errors import SagittalError
from sagittal.server.commands.options import Manifest, Take
from sagittal.server.storage import fs

Span = Annotated[tuple[float, float], Parameter(metavar="FROM TO")]
"""A period of a recording, s."""


def stairs(
    paths: Take,
    /,
    *,
    level: Span,
    up: Span,
    down: Span,
    out: Annotated[Path, Parameter(metavar="JSON")],
    manifest: Manifest = None,
) -> int:
    """Measure the limits on walks of one recording and write them to `out`.

    Parameters
    ----------
    level
        period of level walking, s from the first sample
    up
        period of walking upstairs, s from the first sample
    down
        period of walking downstairs, s from the first sample
    out
        output file for `analyse --config`

    Returns
    -------
    0, or 1 if the limits cannot be determined.
    """
    from sagittal.core.activity.monitor import calibrate_on_walks
    from sagittal.core.formats import list_source_files, read_named_file, read_recording
    from sagittal.core.formats.manifest import parse_manifest
    from sagittal.core.pipeline.activity_stages import find_trunk_stream

    try:
        declared = parse_manifest(read_named_file(manifest)) if manifest else None
        take = read_recording(list(list_source_files(paths)), declared)
        segment, stream = find_trunk_stream(take)
        walks = {"walking": level, "stairs_up": up, "stairs_down": down}
        own = calibrate_on_walks(stream, segment, walks, take.subject.height_m)  # type: ignore[arg-type]
    except SagittalError as error:
        sys.stderr.write(f"No limits of stairs ({error.code}): {error.message}\n")
        return 1
    fs.write_file(out, json.dumps({"activity": {"stairs": asdict(own)}}, indent=1).encode())
    sys.stdout.write(f"Limits of stairs in {out}; give it to `sagittal analyse --config`.\n")
    return 0
