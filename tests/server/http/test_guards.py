from __future__ import annotations

import re
from typing import Any

import httpx
import pytest
import websockets
from starlette.types import Receive, Scope, Send

from sagittal.server.auth.roles import PUBLIC
from sagittal.server.auth.routes import list_declared_actions
from sagittal.server.http.cross_site import CrossSiteGuard
from sagittal.server.http.headers import SecurityHeaders
from sagittal.server.http.hosts import HostGuard
from tests.helpers.clinic import Clinic
from tests.server.serving import serve

pytestmark = pytest.mark.anyio


async def _echo(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        await send({"type": "websocket.close", "code": 1000})
        return
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"reached"})


GUARDED = SecurityHeaders(HostGuard(CrossSiteGuard(_echo), allowed=["gait.example"]))

CSRF = [
    # method, headers, allowed?
    ("POST", {}, True),  # no browser
    ("POST", {"Sec-Fetch-Site": "same-origin"}, True),
    ("POST", {"Sec-Fetch-Site": "none"}, True),  # typed, or a bookmark
    ("POST", {"Sec-Fetch-Site": "same-site"}, False),  # another port or subdomain
    ("POST", {"Sec-Fetch-Site": "cross-site"}, False),
    ("POST", {"Sec-Fetch-Site": "something new"}, False),
    ("POST", {"Origin": "http://gait.example"}, True),  # old browsers
    ("POST", {"Origin": "https://gait.example"}, True),  # behind a TLS proxy
    ("POST", {"Origin": "http://evil.example"}, False),
    ("POST", {"Origin": "http://gait.example.evil.example"}, False),
    ("POST", {"Origin": "http://gait.example:8001"}, False),
    ("POST", {"Origin": "null"}, False),
    ("POST", {"Origin": "http://evil.example", "Sec-Fetch-Site": "same-origin"}, False),
    ("PUT", {"Origin": "http://evil.example"}, False),
    ("PATCH", {"Origin": "http://evil.example"}, False),
    ("DELETE", {"Sec-Fetch-Site": "cross-site"}, False),
    ("GET", {"Sec-Fetch-Site": "cross-site"}, True),  # a link from elsewhere; reading changes nothing
    ("HEAD", {"Origin": "http://evil.example"}, True),
]


@pytest.mark.parametrize(("method", "headers", "allowed"), CSRF)
async def test_csrf_matrix(method: str, headers: dict[str, str], allowed: bool) -> None:
    async with httpx.AsyncClient(transport=httpx.ASGITransport(GUARDED)) as client:
        answer = await client.request(method, "http://gait.example/x", headers=headers)
    assert answer.status_code == (200 if allowed else 403)
    if not allowed:
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["code"] == "cross_site_request"


@pytest.mark.parametrize(
    ("headers", "accepted"),
    [
        ({}, True),
        ({"origin": "http://gait.example"}, True),
        ({"origin": "http://evil.example"}, False),
        ({"origin": "null"}, False),
        ({"origin": "http://gait.example", "sec-fetch-site": "cross-site"}, False),
    ],
)
async def test_a_foreign_page_cannot_open_a_websocket(headers: dict[str, str], accepted: bool) -> None:
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": "websocket.connect"}

    raw = [(b"host", b"gait.example"), *((k.encode(), v.encode()) for k, v in headers.items())]
    await GUARDED({"type": "websocket", "path": "/x", "headers": raw}, receive, send)
    assert next(m["type"] for m in sent) == ("websocket.accept" if accepted else "websocket.close")


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("gait.example", 200),
        ("GAIT.example:8000", 200),
        ("gait.example.", 200),
        ("localhost:8000", 200),
        ("127.0.0.1", 200),
        ("[::1]:8000", 200),
        ("evil.example", 400),
        ("127.0.0.1.evil.example", 400),
        ("localhost@evil.example", 400),
        ("", 400),
    ],
)
async def test_only_our_own_names_are_served(host: str, status: int) -> None:
    async with httpx.AsyncClient(transport=httpx.ASGITransport(GUARDED)) as client:
        answer = await client.get("http://gait.example/x", headers={"Host": host})
    assert answer.status_code == status


async def test_two_host_headers_are_refused() -> None:
    async with httpx.AsyncClient(transport=httpx.ASGITransport(GUARDED)) as client:
        request = client.build_request("GET", "http://gait.example/x")
        request.headers = httpx.Headers([("host", "gait.example"), ("host", "evil.example")])
        answer = await client.send(request)
    assert answer.status_code == 400


@pytest.mark.parametrize("path", ["/", "/health/live", "/static/css/base.css", "/nowhere", "/api/v1/users"])
async def test_every_answer_carries_the_security_headers(clinic: Clinic, path: str) -> None:
    async with clinic.client() as client:
        answer = await client.get(path)
    policy = answer.headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "unsafe" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["x-frame-options"] == "SAMEORIGIN"


async def test_pages_are_not_kept_by_caches_and_assets_are_checked_again(clinic: Clinic) -> None:
    async with clinic.client("admin") as client:
        assert (await client.get("/api/v1/users")).headers["cache-control"] == "no-store"
        asset = await client.get("/static/css/base.css")
        assert asset.headers["cache-control"] == "no-cache"
        second_response = await client.get(
            "/static/css/base.css", headers={"If-None-Match": asset.headers["etag"]}
        )
    assert second_response.status_code == 304


async def test_over_a_real_socket_a_foreign_origin_gets_403_before_accept(clinic: Clinic) -> None:
    async with serve(GUARDED) as port:
        async with websockets.connect(
            f"ws://127.0.0.1:{port}/x", origin=websockets.Origin(f"http://127.0.0.1:{port}")
        ):
            pass
        with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
            async with websockets.connect(
                f"ws://127.0.0.1:{port}/x", origin=websockets.Origin("http://evil.example")
            ):
                pass
    assert refused.value.response.status_code == 403


async def test_the_websockets_of_the_application_refuse_foreign_pages_and_strangers(clinic: Clinic) -> None:
    token = clinic.token("viewer")
    routes = {
        p.partition(" ")[2]: a for p, a in list_declared_actions(clinic.app.routes).items() if "SOCKET" in p
    }
    assert routes
    async with serve(clinic.app) as port:
        for path, action in routes.items():
            url = f"ws://127.0.0.1:{port}" + re.sub(r"\{\w+\}", "0" * 32, path)
            for origin, cookie, status in (
                ("http://evil.example", f"sid={token}", 403),
                (f"http://127.0.0.1:{port}", "sid=wrong", 401),
            ):
                if status == 401 and action in PUBLIC:
                    continue  # its door is the first message (tests/server/live/test_tablet.py)
                with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
                    async with websockets.connect(
                        url, origin=websockets.Origin(origin), additional_headers={"Cookie": cookie}
                    ):
                        pass
                assert refused.value.response.status_code == status
