"""FHIR R4 bundle: a report with one observation per value, UCUM units, codes of our own catalogue.

Observations and report are "preliminary" until the results are signed; the signed report is attached. Most
gait parameters have no LOINC code; `LOINC` lists those with an equivalent one.
"""

from __future__ import annotations

import base64
import hashlib
import json
import uuid
from collections.abc import Sequence
from typing import Any, Final

from sagittal.core.frames import Side
from sagittal.core.parameters.catalogue import require_entries
from sagittal.core.parameters.result import Parameter
from sagittal.server.export.content import ExportContent, SignedForm
from sagittal.server.report.view.level import define_parameter, label_parameter
from sagittal.server.report.words.wording import reason_words

CODES: Final = "urn:sagittal:gait-parameters"
"""Code system of our catalogue, defined by the bundle's CodeSystem."""

SUBJECTS: Final = "urn:sagittal:subjects"
"""Identifier system of the clinic's pseudonyms."""

LOINC: Final = {
    "tug_duration_s": (
        "89423-8",
        "Time to rise from chair, walk 10 feet and back, and return to sitting [TUG]",
    ),
}
"""Parameter → LOINC code and name of the same quantity."""

require_entries(LOINC, "sagittal.server.export.fhir")

UCUM: Final = {
    "": "1",
    "m/s": "m/s",
    "steps/min": "{steps}/min",
    "deg": "deg",
    "%": "%",
    "deg/s": "deg/s",
    "min": "min",
    "m/s2": "m/s2",
    "m2/s4": "m2/s4",
    "m2/s5": "m2/s5",
    "Hz": "Hz",
    "m": "m",
    "s": "s",
}
"""Unit of the catalogue → UCUM."""

SIDE_WORDS: Final[dict[Side | None, str]] = {"left": "Left leg", "right": "Right leg"}

SPREAD: Final = {
    "strides_behind": ("Strides, steps or tests behind the mean", "{count}"),
    "standard_deviation": ("Standard deviation over them", None),
    "uncertainty_95": ("The value ± this holds the true one with 95 %", None),
}
"""Components of an observation → words, and UCUM unit if it differs from the value's."""

REPORT: Final = ("gait_analysis", "Gait analysis by body-worn inertial sensors")
EARLIER: Final = "The attached report was signed before these numbers were changed."
PANEL: Final = ("gait_parameters", "Gait parameters of one take")


def write_fhir(content: ExportContent) -> bytes:
    """Write the bundle as JSON."""
    v, signed = content.visit, content.signed
    patient, device, panel = (_address(content, name) for name in ("patient", "device", "panel"))
    shared = {
        "status": "final" if signed is not None and signed.of_these_numbers else "preliminary",
        "subject": {"reference": patient},
        **({} if v.day is None else {"effectiveDateTime": v.day}),
    }
    values = content.parameters
    observations = {
        _address(content, f"{p.name} {p.side}"): _observe(p) | shared | {"device": {"reference": device}}
        for p in values
    }
    members = [{"reference": address} for address in observations]
    left_out = sum(c.excluded is not None for c in content.cycles)
    resources = {
        patient: _describe_patient(content),
        device: {
            "resourceType": "Device",
            "deviceName": [{"name": "Sagittal", "type": "model-name"}],
            "version": [{"value": v.version or "unknown"}],
        },
        _address(content, "codes"): _define_codes(values),
        panel: {"resourceType": "Observation", "code": _code(*PANEL), **shared}
        | ({"hasMember": members} if members else {"dataAbsentReason": _absent("no value")}),
        **observations,
        _address(content, "report"): {
            "resourceType": "DiagnosticReport",
            "code": _code(*REPORT),
            **shared,
            **({} if signed is None else _attach(signed)),
            "result": [{"reference": panel}],
            "conclusion": " ".join(
                text
                for text in (
                    f"Protocol: {v.protocol}.",
                    f"Condition: {v.condition}." if v.condition else "",
                    f"{len(content.cycles) - left_out} of {len(content.cycles)} strides count.",
                    f"{len(content.edits)} changes by hand.",
                    f"Data: {content.verdict}.",
                    "" if signed is None or signed.of_these_numbers else EARLIER,
                    "Research and documentation software, not a medical device, not for diagnosis.",
                )
                if text
            ),
        },
    }
    bundle = {
        "resourceType": "Bundle",
        "type": "collection",
        "entry": [{"fullUrl": url, "resource": resource} for url, resource in resources.items()],
    }
    return json.dumps(bundle, ensure_ascii=False, allow_nan=False, indent=1).encode()


def _attach(signed: SignedForm) -> dict[str, Any]:
    """Signature metadata and documents. FHIR prescribes SHA-1 as the hash of an attachment."""
    return {
        "issued": signed.signed_at,
        "resultsInterpreter": [{"display": signed.signed_by or "unknown"}],
        "presentedForm": [
            {
                "contentType": media_type,
                "language": signed.language,
                "data": base64.b64encode(content).decode(),
                "size": len(content),
                "hash": base64.b64encode(hashlib.sha1(content, usedforsecurity=False).digest()).decode(),
                "title": f"Signed report, version {signed.version}",
                "creation": signed.signed_at,
            }
            for media_type, content in signed.documents
        ],
    }


def _address(content: ExportContent, name: str) -> str:
    """URN of a resource in the bundle, stable for the same visit."""
    return (
        f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_OID, f'{content.visit.subject} {content.visit.visit} {name}')}"
    )


def _code(code: str, words: str) -> dict[str, Any]:
    """One of our codes, with its LOINC code if there is one."""
    coding = [{"system": CODES, "code": code, "display": words}]
    if code in LOINC:
        number, display = LOINC[code]
        coding.append({"system": "http://loinc.org", "code": number, "display": display})
    return {"coding": coding, "text": words}


def _quantity(value: float, unit: str, ucum: str) -> dict[str, Any]:
    return {
        "value": round(value, 6),
        "unit": unit or ucum,
        "system": "http://unitsofmeasure.org",
        "code": ucum,
    }


def _ucum(unit: str) -> str:
    """UCUM form of a unit; unsupported ones become an annotation."""
    return UCUM.get(unit, f"{{{unit}}}")


def _absent(reason: str) -> dict[str, Any]:
    system = "http://terminology.hl7.org/CodeSystem/data-absent-reason"
    return {"coding": [{"system": system, "code": "unknown"}], "text": reason}


def _observe(p: Parameter) -> dict[str, Any]:
    """Observation of one value with its spread, or the reason of its absence."""
    observation: dict[str, Any] = {
        "resourceType": "Observation",
        "code": _code(p.name, label_parameter(p.name)),
    }
    if p.side is not None:
        observation["bodySite"] = {"text": SIDE_WORDS[p.side]}
    if p.mean is None:
        return observation | {"dataAbsentReason": _absent(reason_words(p.reason))}
    observation["valueQuantity"] = _quantity(p.mean, p.unit, _ucum(p.unit))
    components = {"strides_behind": p.n, "standard_deviation": p.sd, "uncertainty_95": p.uncertainty}
    observation["component"] = [
        {
            "code": _code(name, SPREAD[name][0]),
            "valueQuantity": _quantity(value, p.unit if own is None else "", own or _ucum(p.unit)),
        }
        for name, value in components.items()
        if value is not None
        for own in (SPREAD[name][1],)
    ]
    if p.estimated:
        observation["note"] = [{"text": "From a model of the leg; no two sensors measure this angle."}]
    return observation


def _describe_patient(content: ExportContent) -> dict[str, Any]:
    v = content.visit
    resource = {
        "resourceType": "Patient",
        "identifier": [{"system": SUBJECTS, "value": v.code or v.subject}],
    }
    return resource | ({} if v.sex is None else {"gender": v.sex})


def _define_codes(values: Sequence[Parameter]) -> dict[str, Any]:
    """Code system with the part of our catalogue used in the bundle."""
    words = dict((REPORT, PANEL)) | {name: text for name, (text, _) in SPREAD.items()}
    concepts: list[dict[str, str]] = [{"code": code, "display": text} for code, text in words.items()]
    for name in dict.fromkeys(p.name for p in values):
        definition = define_parameter(name)
        more = {"display": label_parameter(name), "definition": definition} if definition else {}
        concepts.append({"code": name, **more})
    return {
        "resourceType": "CodeSystem",
        "url": CODES,
        "name": "SagittalGaitParameters",
        "status": "active",
        "content": "fragment",
        "concept": concepts,
    }
