"""A signed-in person, as one request knows him or her."""

from __future__ import annotations

from dataclasses import dataclass

from sagittal.server.auth.roles import Action, Role, is_permitted


@dataclass(frozen=True)
class Identity:
    """Who is asking.

    Parameters
    ----------
    user_id, name, display_name, role : the account. language : of the pages, None = the browser's.
    login_id : which sign-in this is (two browsers of one person are two); the hash of its token.
    allowed : the actions of the API token that asks, None = a person at a browser.
    opens : whether this person may open what the address of the request names (server/auth/sight.py).
    """

    user_id: str
    name: str
    display_name: str
    role: Role
    login_id: str
    language: str | None = None
    allowed: frozenset[Action] | None = None
    opens: bool = True

    @property
    def token_id(self) -> str | None:
        """The API token that asks, None = a person at a browser."""
        return None if self.allowed is None else self.login_id.removeprefix("token:")

    @property
    def is_admin(self) -> bool:
        """Whether this person runs the clinic's accounts and care teams, and so sees every patient."""
        return self.role is Role.ADMIN

    def may(self, action: Action) -> bool:
        """Tell whether this person's role allows the action; pages ask it what to offer."""
        return is_permitted(self.role, action) and (self.allowed is None or action in self.allowed)
