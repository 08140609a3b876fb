"""Proposed set-up corrections as data that can be applied, stored and reapplied."""

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
    """One kind of set-up mistake and its correction, to be confirmed by the user.

    Parameters
    ----------
    kind : units or signs of sensors, their axes, segment labels, or the declared sensor placement.
    segments : device id → segment, of all sensors, if labels are wrong; else empty.
    corrections : device id → correction, of the sensors that need one. mounting : segment → corrected
    placement text, if the declared one is wrong. All empty: a mistake without a known correction.
    evidence : sentences.
    margin : misfit as declared over that of the proposal; 1 if unknown, infinite if the declaration is
    physically impossible.
    """

    kind: SetupMistake
    evidence: tuple[str, ...]
    margin: float
    segments: Mapping[str, Segment] = field(default_factory=dict)
    corrections: Mapping[str, SensorCorrection] = field(default_factory=dict)
    mounting: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_sure(self) -> bool:
        """Whether the proposal fits better by a measured `margin`, so that an analysis without it would be
        wrong.

        Physically impossible units have no margin: they are errors of the quality report.
        """
        return self.can_be_applied and 1.0 < self.margin < inf

    @property
    def can_be_applied(self) -> bool:
        """Whether the proposal contains a correction."""
        return bool(self.segments or self.corrections or self.mounting)

    def tell(self, severity: Literal["warning", "error"]) -> Notice:
        """Notice with the mistake and its correction."""
        todo = (
            "A correction is proposed; confirm it and re-analyse."
            if self.can_be_applied
            else "No correction can be proposed; check the sensor set-up."
        )
        return Notice("setup_wrong", join_messages(*self.evidence, todo), severity=severity)

    def complete_manifest(self, manifest: Mapping[str, Any]) -> dict[str, Any]:
        """Manifest with this correction added; other entries are kept, earlier corrections are applied
        first.
        """
        result = dict(manifest)
        if self.segments:
            other_entries = {d: s for d, s in (result.get("sensors") or {}).items() if s is None}
            mine = {d.lower() for d in self.segments}
            result["sensors"] = {d: s for d, s in other_entries.items() if d.lower() not in mine} | dict(
                self.segments
            )
        if self.corrections:
            earlier = {
                d.lower(): x
                for d, x in manifest_of({"corrections": result.get("corrections")}).corrections.items()
            }
            mine = {d.lower() for d in self.corrections}
            kept_corrections = {
                d: x for d, x in (result.get("corrections") or {}).items() if d.lower() not in mine
            }
            result["corrections"] = kept_corrections | {
                d: x.follow(earlier.get(d.lower(), SensorCorrection())).to_json()
                for d, x in self.corrections.items()
            }
        if self.mounting:
            other_entries = {
                k: x
                for k, x in (result.get("mounting") or {}).items()
                if segment_named(k) not in self.mounting
            }
            result["mounting"] = other_entries | dict(self.mounting)
        return result

    def to_json(self) -> dict[str, object]:
        """JSON-serialisable values; `repair` is the correction as a manifest, None if unknown."""
        return {
            "kind": self.kind,
            "evidence": list(self.evidence),
            "margin": round(self.margin, 3) if isfinite(self.margin) else None,
            "repair": self.complete_manifest({}) if self.can_be_applied else None,
        }
