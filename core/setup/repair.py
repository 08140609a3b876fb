"""What is proposed where a set-up is wrong: data that can be applied, kept and applied again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, isfinite
from typing import Any, Literal

from sagittal.core.errors import Notice
from sagittal.core.formats.aliases import segment_named
from sagittal.core.formats.manifest import manifest_of
from sagittal.core.frames import Segment
from sagittal.core.message import join_messages
from sagittal.core.signals.correction import SensorCorrection

SetupMistake = Literal["units", "axes", "labels", "mounting"]


@dataclass(frozen=True)
class SetupRepair:
    """One kind of mistake and what would put it right; a person confirms it.

    Parameters
    ----------
    kind : units or signs of sensors, their axes, who wears what, or how it is said to sit.
    segments : device id → segment, of all worn sensors, where labels are wrong; else empty.
    corrections : device id → correction, of the sensors that need one. mounting : segment → words that say
        how its sensor sits, where the declared ones are wrong. All empty: something is wrong, and what would
        put it right cannot be said.
    evidence : sentences.
    margin : misfit as stated over that of the proposal; 1 where that is not known, infinite where physics
        refuses what is stated.
    """

    kind: SetupMistake
    evidence: tuple[str, ...]
    margin: float
    segments: Mapping[str, Segment] = field(default_factory=dict)
    corrections: Mapping[str, SensorCorrection] = field(default_factory=dict)
    mounting: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_sure(self) -> bool:
        """Whether it fits better by a measured `margin`, so that an analysis without it would be wrong.

        Units that physics refuses have none: they are errors of the quality report.
        """
        return self.can_be_applied and 1.0 < self.margin < inf

    @property
    def can_be_applied(self) -> bool:
        """Whether it says what to do."""
        return bool(self.segments or self.corrections or self.mounting)

    def tell(self, severity: Literal["warning", "error"]) -> Notice:
        """The notice that says what is wrong and what would put it right."""
        todo = (
            "A repair is proposed; confirm it and analyse again."
            if self.can_be_applied
            else "What would put it right cannot be said; check the set-up of the sensors."
        )
        return Notice("setup_wrong", join_messages(*self.evidence, todo), severity=severity)

    def complete_manifest(self, manifest: Mapping[str, Any]) -> dict[str, Any]:
        """A manifest with this repair; what else it says stays, earlier corrections come first."""
        said = dict(manifest)
        if self.segments:
            others = {d: s for d, s in (said.get("sensors") or {}).items() if s is None}
            mine = {d.lower() for d in self.segments}
            said["sensors"] = {d: s for d, s in others.items() if d.lower() not in mine} | dict(self.segments)
        if self.corrections:
            before = {
                d.lower(): x
                for d, x in manifest_of({"corrections": said.get("corrections")}).corrections.items()
            }
            mine = {d.lower() for d in self.corrections}
            kept = {d: x for d, x in (said.get("corrections") or {}).items() if d.lower() not in mine}
            said["corrections"] = kept | {
                d: x.follow(before.get(d.lower(), SensorCorrection())).to_json()
                for d, x in self.corrections.items()
            }
        if self.mounting:
            others = {
                k: x for k, x in (said.get("mounting") or {}).items() if segment_named(k) not in self.mounting
            }
            said["mounting"] = others | dict(self.mounting)
        return said

    def to_json(self) -> dict[str, object]:
        """Plain values; `repair` is what a manifest would say of it, None where nobody knows."""
        return {
            "kind": self.kind,
            "evidence": list(self.evidence),
            "margin": round(self.margin, 3) if isfinite(self.margin) else None,
            "repair": self.complete_manifest({}) if self.can_be_applied else None,
        }
