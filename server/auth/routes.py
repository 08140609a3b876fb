"""Deny by default: the application refuses to start if a route declares no action."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import fastapi.routing
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute, APIWebSocketRoute
from starlette.routing import BaseRoute

from sagittal.server.auth.access import RouteAccess
from sagittal.server.auth.roles import Action
from sagittal.server.auth.sight import OF_NOBODY, OWNER


class UndeclaredRouteError(RuntimeError):
    """A route does not declare exactly one action or the owner of a path parameter; use
    `require(Action.…)`.
    """


def list_declared_actions(routes: Sequence[BaseRoute]) -> dict[str, Action]:
    """Return the action of each route by its methods and path, including websockets and static mounts.

    Raises
    ------
    UndeclaredRouteError
        a route declares no action or several, or the owner of a path parameter is unknown.
    """
    declared: dict[str, Action] = {}
    for path, route in _leaves(routes):
        actions = _actions(route)
        name = f"{_methods(route)} {path}"
        if len(actions) != 1:
            names = ", ".join(sorted(actions)) or "none"
            raise UndeclaredRouteError(f"Route {name}: expected one declared action, found {names}.")
        unknown = set(re.findall(r"\{(\w+)", path)) - OWNER.keys() - OF_NOBODY
        if unknown:
            raise UndeclaredRouteError(
                f"Route {name}: nothing says whose {', '.join(sorted(unknown))} is; see server/auth/sight.py."
            )
        declared[name] = actions.pop()
    return declared


def _leaves(routes: Sequence[BaseRoute]) -> Iterator[tuple[str, BaseRoute]]:
    """Yield every route with its full path."""
    # newer FastAPI keeps an included router as one entry and provides this iteration; older ones copy its
    # routes
    contexts = getattr(fastapi.routing, "iter_route_contexts", None)
    if contexts is None:
        yield from ((getattr(route, "path", ""), route) for route in routes)
    else:
        yield from ((context.path or "", context.original_route) for context in contexts(routes))


def _actions(route: BaseRoute) -> set[Action]:
    if isinstance(route, APIRoute | APIWebSocketRoute):
        return {d.call.action for d in _walk(route.dependant) if isinstance(d.call, RouteAccess)}
    # a mounted application declares its action itself
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
