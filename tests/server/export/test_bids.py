"""A BIDS-motion data set by the rules of the standard's own schema."""

from __future__ import annotations

import csv
import io
import json
import re
import zipfile
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.events.edits import Edit
from sagittal.server.export.bids import write_bids
from sagittal.server.export.content import ExportContent, VisitFacts
from sagittal.server.report.files import signals
from sagittal.server.report.files.columns import floats_of
from tests.server import analysed
from tests.server.export.opened import open_walk

bids_schema = pytest.importorskip("bidsschematools.schema")
SUBJECT = "sub-s1/ses-v1/motion/sub-s1_ses-v1_task-Walk"


def written(content: ExportContent) -> dict[str, bytes]:
    archive = zipfile.ZipFile(io.BytesIO(write_bids(content)))
    return {name: archive.read(name) for name in archive.namelist()}


def rows(data: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(data.decode()), delimiter="\t", quoting=csv.QUOTE_NONE))


def check_name(path: str, schema: Any) -> None:
    """A file of a subject has the entities that its suffix requires, in the standard's order, no others."""
    *folders, name = path.split("/")
    stem, ending = name.split(".")
    *pairs, suffix = stem.split("_")
    entities = dict(pair.split("-") for pair in pairs)
    assert folders == [f"sub-{entities['sub']}", f"ses-{entities['ses']}", "motion"]
    assert all(re.fullmatch(r"[0-9a-zA-Z]+", value) for value in entities.values())
    long = {schema.objects.entities[e].name: e for e in schema.rules.entities}
    assert list(entities) == [short for short in long if short in entities]
    (rule,) = [
        r
        for group in schema.rules.files.raw.values()
        for r in group.values()
        if suffix in r.suffixes and "motion" in r.datatypes
    ]
    assert f".{ending}" in rule.extensions
    inputs = {long[short] for short in entities}
    required = {e for e, level in rule.entities.items() if level == "required"}
    assert required <= inputs <= set(rule.entities)


@pytest.mark.slow
def test_names_fields_columns_and_counts_are_those_of_the_standard() -> None:
    schema = bids_schema.load_schema()
    files = written(open_walk())
    top = {name for name in files if "/" not in name}
    assert top == {"dataset_description.json", "README", "participants.tsv", "participants.json"}
    for path in files.keys() - top:
        check_name(path, schema)
    described = json.loads(files["dataset_description.json"])
    assert {"Name", "BIDSVersion"} <= set(described)

    tracked = f"{SUBJECT}_tracksys-imu"
    document, channels = json.loads(files[f"{tracked}_motion.json"]), rows(files[f"{tracked}_channels.tsv"])
    for group in schema.rules.sidecars.motion.values():
        for name, rule in group.fields.items():
            if (rule if isinstance(rule, str) else rule["level"]) == "required":
                assert name in document
    assert document["TrackingSystemName"] == "imu"
    rule = schema.rules.tabular_data.motion.motionChannels
    columns = [schema.objects.columns[n].name for n, level in rule.columns.items() if level == "required"]
    assert list(channels[0])[: len(columns)] == columns
    for row in channels:
        assert row["component"] in schema.objects.columns.component.enum
        assert row["type"] in {"ACCEL", "GYRO"}
        assert (
            row["reference_frame"]
            in json.loads(files[f"{tracked}_channels.json"])["reference_frame"]["Levels"]
        )
    assert len({row["name"] for row in channels}) == len(channels) == document["MotionChannelCount"]
    assert len({row["tracked_point"] for row in channels}) == document["TrackedPointsCount"]
    for kind in ("ACCEL", "GYRO", "MAGN"):
        assert sum(row["type"] == kind for row in channels) == document[f"{kind}ChannelCount"]
    motion = files[f"{tracked}_motion.tsv"].decode().split("\n")
    assert {len(line.split("\t")) for line in motion[:-1]} == {len(channels)}
    assert len(motion) - 1 == document["RecordingDuration"] * document["SamplingFrequency"]


def test_signals_are_the_stored_ones_in_si_units() -> None:
    content = open_walk()
    table, _ = content.signals
    files = written(content)
    names = [row["name"] for row in rows(files[f"{SUBJECT}_tracksys-imu_channels.tsv"])]
    motion = np.genfromtxt(io.BytesIO(files[f"{SUBJECT}_tracksys-imu_motion.tsv"]), missing_values="n/a")
    turning = np.radians(floats_of(table, "foot_l_gyr_z_dps"))
    assert motion[:, names.index("foot_l_GYRO_z")] == pytest.approx(turning, abs=1e-6)


def test_events_say_which_strides_were_left_out_and_by_whom() -> None:
    cycle = next(c for c in open_walk().cycles if c.excluded is None)
    edit = Edit("exclude_stride", cycle.side, (cycle.start_s + cycle.end_s) / 2, reason="stumbled")
    result = rows(written(open_walk(edit))[f"{SUBJECT}_events.tsv"])
    assert [float(row["onset"]) for row in result] == sorted(float(row["onset"]) for row in result)
    assert list(result[0])[:2] == ["onset", "duration"]
    (out,) = [row for row in result if row["excluded_reason"] == "manual:stumbled"]
    assert (out["trial_type"], out["side"], out["counted"]) == ("stride", cycle.side, "0")
    assert float(out["onset"]) == pytest.approx(cycle.start_s)


def test_nobody_is_named_and_great_age_is_not_told() -> None:
    notices = VisitFacts(
        "a b-7", "Mueller 1931", "v/1", "2026-03-02", age_years=94, sex="male", condition="comfortable pace"
    )
    files = written(replace(open_walk(), visit=notices))
    (person,) = rows(files["participants.tsv"])
    assert (person["participant_id"], person["age"], person["sex"]) == ("sub-ab7", "89+", "M")
    everything = b" ".join([*files.values(), *(name.encode() for name in files)])
    assert b"Mueller" not in everything
    assert b"2026" not in everything
    with pytest.raises(FormatError, match=r"no signals\.parquet"):
        write_bids(open_walk(files={n: x for n, x in analysed.files().items() if n != signals.NAME}))
