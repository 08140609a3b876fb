"""Deny by default: an application with a route that declares no action does not start."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute, APIWebSocketRoute
from starlette.routing import BaseRoute

from server.auth.access import Door
from server.auth.roles import PUBLIC, Action


class UndeclaredRouteError(RuntimeError):
    """A route says not exactly one action; name it with `require(Action.…)`."""


def declared_actions(routes: Iterable[BaseRoute]) -> dict[str, Action]:
    """Return each route's action by its methods and path, websockets and static mounts included.

    Raises
    ------
    UndeclaredRouteError
        a route declares no action, or several.
    """
    found: dict[str, Action] = {}
    for route in _leaves(routes):
        actions = _actions(route)
        name = f"{_methods(route)} {getattr(route, 'path', route)}"
        if len(actions) != 1:
            said = ", ".join(sorted(actions)) or "none"
            raise UndeclaredRouteError(f"Route {name}: expected one declared action, found {said}.")
        found[name] = actions.pop()
    return found


def is_public(route: BaseRoute) -> bool:
    """Tell whether a route needs no sign-in."""
    return _actions(route) <= PUBLIC


def _leaves(routes: Iterable[BaseRoute]) -> Iterator[BaseRoute]:
    for route in routes:
        # FastAPI keeps an included router as one route around the original (0.13x and later)
        inner = getattr(route, "original_router", None)
        if inner is None:
            yield route
        else:
            yield from _leaves(inner.routes)


def _actions(route: BaseRoute) -> set[Action]:
    if isinstance(route, APIRoute | APIWebSocketRoute):
        return {d.call.action for d in _walk(route.dependant) if isinstance(d.call, Door)}
    # a mounted application names its action itself
    action = getattr(getattr(route, "app", None), "action", None)
    return {action} if isinstance(action, Action) else set()


def _walk(dependant: Dependant) -> Iterator[Dependant]:
    for inner in dependant.dependencies:
        yield inner
        yield from _walk(inner)


def _methods(route: BaseRoute) -> str:
    if isinstance(route, APIWebSocketRoute):
        return "WEBSOCKET"
    return ",".join(sorted(getattr(route, "methods", None) or {"MOUNT"}))
