"""Names of the schemes of adaptive gains; separate from the gains, which take long to import."""

from __future__ import annotations

from typing import Literal

Scheme = Literal["fixed", "two_levels", "three_levels"]
"""FOG, VST1 and VST2 of Nazarahari 2021, section 4.2.2.1."""
