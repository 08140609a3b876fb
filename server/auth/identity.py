"""Identity of the signed-in user for one request."""

from __future__ import annotations

from dataclasses import dataclass

from sagittal.server.auth.roles import Action, Role, is_permitted


@dataclass(frozen=True)
class Identity:
    """Signed-in user of a request.

    Parameters
    ----------
    user_id, name, display_name, role : the account. language : of the pages, None = as set in the browser.
    login_id : the sign-in (each browser has its own), identified by the hash of its token.
    allowed : actions permitted to the API token of the request, None = a browser session.
    opens : whether the user may open the resources in the request path (server/auth/sight.py).
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
        """Id of the API token, None for a browser session."""
        return None if self.allowed is None else self.login_id.removeprefix("token:")

    @property
    def is_admin(self) -> bool:
        """Whether the user administers accounts and care teams, and therefore sees every patient."""
        return self.role is Role.ADMIN

    def may(self, action: Action) -> bool:
        """Whether the user's role permits the action; pages use it to choose which controls to show."""
        return is_permitted(self.role, action) and (self.allowed is None or action in self.allowed)
