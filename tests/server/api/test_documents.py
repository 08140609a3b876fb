"""OpenAPI document and server agree on media types, methods and refusals."""

from __future__ import annotations

import re

import pytest

from sagittal.server.api.documents import openapi
from tests.helpers.clinic import Clinic

pytestmark = pytest.mark.anyio

API = "/api/v1"
VALUES = {"number": "0", "name": "a", "device_id": "00B40000"}


def fill(path: str) -> str:
    """A path of the document with ids in it."""
    return re.sub(r"\{(\w+)\}", lambda part: VALUES.get(part[1], "0" * 32), path)


async def test_operations_that_send_files_of_any_type_declare_json_as_json(clinic: Clinic) -> None:
    contents = {
        path: operation["responses"]["200"]["content"]
        for path, item in openapi(clinic.app)["paths"].items()
        for operation in item.values()
        if "*/*" in operation["responses"].get("200", {}).get("content", {})
    }
    assert f"{API}/analyses/{{analysis_id}}/files/{{name}}" in contents
    for path, content in contents.items():
        assert content.get("application/json") == {"schema": {}}, path


@pytest.mark.slow
async def test_allow_names_every_method_of_a_path(clinic: Clinic) -> None:
    offered: dict[str, set[str]] = {}
    paths = openapi(clinic.app)["paths"]
    for path, item in paths.items():
        pattern = re.compile(re.sub(r"\{\w+\}", "[^/]+", path))
        for second in paths:
            if pattern.fullmatch(fill(second)):
                offered.setdefault(second, set()).update(method.upper() for method in item)
    assert any(len(methods) > 2 for methods in offered.values())
    async with clinic.client("admin") as client:
        for path, methods in offered.items():
            answer = await client.options(fill(path))
            assert answer.status_code == 405, path
            assert set(answer.headers["allow"].split(", ")) == methods, path


@pytest.mark.parametrize(("method", "more"), [("POST", ""), ("PUT", "/0"), ("POST", "/end")])
@pytest.mark.parametrize("headers", [{}, {"Authorization": "Bearer nothing"}, {"Authorization": "x" * 300}])
async def test_a_film_without_its_token_is_not_signed_in(
    clinic: Clinic, method: str, more: str, headers: dict[str, str]
) -> None:
    body = {"json": {"consent": True, "began_us": 1}} if not more else {"content": b"x"}
    async with clinic.client(headers=headers) as client:
        answer = await client.request(method, f"{API}/live/takes/{'0' * 32}/film{more}", **body)
    assert (answer.status_code, answer.json()["code"]) == (401, "token_not_valid")
