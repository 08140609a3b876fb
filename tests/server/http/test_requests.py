"""Request lines of the JSON log."""

from __future__ import annotations

import io
import json
import logging
from pathlib import Path

import pytest

from sagittal.server.log import JsonLines, request_id, start_log
from sagittal.server.settings import Settings, SettingsError
from tests.helpers.clinic import open_clinic

pytestmark = pytest.mark.anyio


async def test_each_request_is_one_object_with_its_id_and_no_name(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "sagittal.server.http.requests")
    async with open_clinic(tmp_path, log_format="json") as clinic, clinic.client("admin") as client:
        answer = await client.get("/api/v1/patients?search=Kanari")
    record = caplog.records[-1]
    line = json.loads(JsonLines().format(record))
    assert (line["message"], line["route"], line["status"]) == ("request", "/api/v1/patients", 200)
    assert line["took_s"] > 0
    assert "Kanari" not in JsonLines().format(record)
    assert len(answer.headers["x-request-id"]) == 16


def test_a_line_has_the_request_it_belongs_to_and_the_error(tmp_path: Path) -> None:
    handler = logging.StreamHandler(io.StringIO())
    start_log(Settings(data_dir=tmp_path, log_format="json"), handler)
    own = logging.getLogger("server.of_this_test")
    own.addHandler(handler)
    token = request_id.set("0123456789abcdef")
    try:
        raise ValueError("odd")
    except ValueError:
        own.exception("failed %d", 3)
    finally:
        request_id.reset(token)
        own.removeHandler(handler)
        logging.getLogger().removeHandler(handler)
    line = json.loads(handler.stream.getvalue().splitlines()[0])
    assert (line["level"], line["message"], line["request_id"]) == ("error", "failed 3", "0123456789abcdef")
    assert "ValueError: odd" in line["error"]
    with pytest.raises(SettingsError, match="text or json"):
        Settings(data_dir=tmp_path, log_format="xml")
