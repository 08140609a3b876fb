"""What endpoints take from the running application, by real requests."""

from __future__ import annotations

import datetime as dt
from collections.abc import AsyncIterator, Mapping
from typing import Any, get_args, get_type_hints

import httpx
import pytest
from fastapi import FastAPI, Request

from sagittal.server import context
from sagittal.server.context import DeviceId, Id, StudyVisits, address_of
from sagittal.server.downloads.studies import StudyChoice

pytestmark = pytest.mark.anyio

PARTS: Mapping[str, Any] = {
    "settings": context.Config,
    "db": context.Db,
    "blobs": context.Blobs,
    "reviewed": context.Reviewed,
    "logins": context.OpenLogins,
    "trail": context.OpenTrail,
    "throttle": context.Failures,
    "queue": context.Queue,
    "feed": context.Feed,
    "hub": context.LiveHub,
    "films": context.Films,
}


@pytest.fixture
def app() -> FastAPI:
    return FastAPI()


@pytest.fixture
async def client(app: FastAPI) -> AsyncIterator[httpx.AsyncClient]:
    transport = httpx.ASGITransport(app, client=("192.0.2.7", 5000))
    async with httpx.AsyncClient(transport=transport, base_url="http://clinic") as async_client:
        yield async_client


@pytest.mark.parametrize("name", PARTS)
async def test_every_part_is_the_one_of_this_name(app: FastAPI, client: httpx.AsyncClient, name: str) -> None:
    for reference in PARTS:
        setattr(app.state, reference, f"the {reference}")

    async def ask(part: Any) -> str:
        return str(part)

    ask.__annotations__["part"] = PARTS[name]
    app.get("/")(ask)
    assert (await client.get("/")).json() == f"the {name}"


def test_every_part_has_the_type_that_the_state_gives_it() -> None:
    types = get_type_hints(context.State)
    assert {name: get_args(part)[0] for name, part in PARTS.items()} == {name: types[name] for name in PARTS}


@pytest.fixture
def choices(app: FastAPI) -> list[StudyChoice]:
    """Every choice that an endpoint got."""
    result: list[StudyChoice] = []

    @app.get("/study")
    async def study(choice: StudyVisits) -> None:
        result.append(choice)

    return result


A, B = "a" * 32, "b" * 32


@pytest.mark.parametrize(
    ("asked", "choice"),
    [
        ("", StudyChoice()),
        ("q=&protocol=&since=&until=", StudyChoice()),
        (
            "q=knee&protocol=walk&since=2026-03-02&until=2026-03-09",
            StudyChoice("knee", "walk", dt.date(2026, 3, 2), dt.date(2026, 3, 9)),
        ),
        (f"visit={A}&visit={B}", StudyChoice(visits=frozenset({A, B}))),
        (f"visit={A}&ticked=true", StudyChoice(visits=frozenset({A}))),
        ("ticked=true", StudyChoice(visits=frozenset())),
    ],
)
async def test_a_choice_of_visits_is_what_the_address_says(
    client: httpx.AsyncClient, choices: list[StudyChoice], asked: str, choice: StudyChoice
) -> None:
    assert (await client.get(f"/study?{asked}")).status_code == 200
    assert choices == [choice]


@pytest.mark.parametrize(
    "asked", ["protocol=moonwalk", "since=yesterday", f"visit={A}g", f"visit={A[1:]}", f"q={'x' * 201}"]
)
async def test_what_is_no_choice_is_refused(
    client: httpx.AsyncClient, choices: list[StudyChoice], asked: str
) -> None:
    assert (await client.get(f"/study?{asked}")).status_code == 422
    assert choices == []


async def test_more_visits_than_a_hundred_are_refused(
    client: httpx.AsyncClient, choices: list[StudyChoice]
) -> None:
    for number, status in ((100, 200), (101, 422)):
        requested_text = "&".join(f"visit={i:032x}" for i in range(number))
        assert (await client.get(f"/study?{requested_text}")).status_code == status
    assert len(choices) == 1


async def test_identifiers_are_checked_and_the_caller_has_an_address(
    app: FastAPI, client: httpx.AsyncClient
) -> None:
    @app.get("/one/{one}")
    async def by_id(one: Id, request: Request) -> str:
        return address_of(request)

    @app.get("/device/{one}")
    async def by_serial(one: DeviceId) -> str:
        return one

    assert (await client.get(f"/one/{A}")).json() == "192.0.2.7"
    assert (await client.get(f"/one/{A.upper()}")).status_code == 422
    assert (await client.get("/device/D4:22-CD")).json() == "D4:22-CD"
    for wrong in ("X", "x" * 33, "a_b"):
        assert (await client.get(f"/device/{wrong}")).status_code == 422


def test_a_caller_without_an_address_is_unknown() -> None:
    assert address_of(Request({"type": "http", "headers": []})) == "unknown"
