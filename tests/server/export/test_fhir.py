"""The FHIR bundle, read by a library of the standard's R4 models."""

from __future__ import annotations

import base64
import hashlib
import json
from dataclasses import replace
from typing import Any

import pytest

from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.result import Parameter
from sagittal.server.export.content import ExportContent, SignedForm
from sagittal.server.export.fhir import CODES, EARLIER, LOINC, UCUM, write_fhir
from tests.server.export.opened import open_walk

models = pytest.importorskip("fhir.resources.R4B.bundle")


def resources(content: ExportContent) -> dict[str, dict[str, Any]]:
    data = write_fhir(content)
    models.Bundle.model_validate_json(data)
    return {entry["fullUrl"]: entry["resource"] for entry in json.loads(data)["entry"]}


def references(value: Any) -> list[str]:
    if isinstance(value, dict):
        own = [value["reference"]] if isinstance(value.get("reference"), str) else []
        return own + [r for x in value.values() for r in references(x)]
    return [r for x in value for r in references(x)] if isinstance(value, list) else []


def codes(value: Any) -> set[str]:
    if isinstance(value, dict):
        own = {value["code"]} if value.get("system") == CODES else set()
        return own.union(*(codes(x) for x in value.values()))
    return set().union(*(codes(x) for x in value)) if isinstance(value, list) else set()


@pytest.mark.slow
def test_the_bundle_is_valid_whole_and_holds_every_value() -> None:
    content = open_walk()
    result = resources(content)
    assert set(references(list(result.values()))) <= set(result)
    (system,) = [r for r in result.values() if r["resourceType"] == "CodeSystem"]
    assert codes([r for r in result.values() if r is not system]) <= {c["code"] for c in system["concept"]}
    (report,) = [r for r in result.values() if r["resourceType"] == "DiagnosticReport"]
    panel = result[report["result"][0]["reference"]]
    members = [result[m["reference"]] for m in panel["hasMember"]]
    assert len(members) == len(content.bundle.parameters)
    for member, p in zip(members, content.bundle.parameters, strict=True):
        assert member["code"]["coding"][0] == {
            "system": CODES,
            "code": p.name,
            "display": CATALOGUE[p.name].label,
        }
        assert member.get("bodySite", {}).get("text") == (p.side and f"{p.side.capitalize()} leg")
        if p.mean is None:
            assert "valueQuantity" not in member
            assert member["dataAbsentReason"]["text"]
        else:
            assert member["valueQuantity"]["value"] == pytest.approx(p.mean, abs=1e-6)
            assert member["valueQuantity"]["code"] == UCUM[p.unit]


def test_it_tells_a_pseudonym_a_day_and_that_nobody_signed() -> None:
    values = resources(open_walk()).values()
    (patient,) = [r for r in values if r["resourceType"] == "Patient"]
    assert set(patient) == {"resourceType", "identifier", "gender"}
    for r in values:
        if r["resourceType"] in ("Observation", "DiagnosticReport"):
            assert (r["status"], r["effectiveDateTime"]) == ("preliminary", "2026-03-02")


@pytest.mark.slow
def test_the_signed_report_is_attached_and_makes_its_own_numbers_final() -> None:
    page, paper = "<p>Unterschrieben: Gänge</p>".encode(), b"%PDF-1.7"
    documents = (("application/pdf", paper), ("text/html", page))
    signed = SignedForm(2, "de", "Therapist 1", "2026-03-03T10:00:00+00:00", True, documents)
    values = resources(replace(open_walk(), signed=signed)).values()
    (report,) = [r for r in values if r["resourceType"] == "DiagnosticReport"]
    assert {r["status"] for r in values if "status" in r and "subject" in r} == {"final"}
    assert report["resultsInterpreter"] == [{"display": "Therapist 1"}]
    for form, (media_type, content) in zip(report["presentedForm"], documents, strict=True):
        assert (form["contentType"], form["size"], form["language"]) == (media_type, len(content), "de")
        assert base64.b64decode(form["data"]) == content
        assert base64.b64decode(form["hash"]) == hashlib.sha1(content, usedforsecurity=False).digest()
    assert EARLIER not in report["conclusion"]
    later = resources(replace(open_walk(), signed=replace(signed, of_these_numbers=False))).values()
    (report,) = [r for r in later if r["resourceType"] == "DiagnosticReport"]
    assert report["status"] == "preliminary"
    assert EARLIER in report["conclusion"]
    assert len(report["presentedForm"]) == 2


def test_every_unit_of_the_catalogue_has_its_ucum_code_and_loinc_stands_beside_ours() -> None:
    assert {entry.unit for entry in CATALOGUE.values()} <= set(UCUM)
    assert set(LOINC) <= set(CATALOGUE)
    content = open_walk()
    tug = Parameter("tug_duration_s", None, 1, 11.25, None, "s")
    timed = replace(content, bundle=replace(content.bundle, parameters=(tug,)))
    (one,) = [r for r in resources(timed).values() if "valueQuantity" in r]
    assert [c["system"] for c in one["code"]["coding"]] == [CODES, "http://loinc.org"]
    assert (one["code"]["coding"][1]["code"], one["valueQuantity"]["code"]) == ("89423-8", "s")
    nothing = replace(content, bundle=replace(content.bundle, parameters=()))
    assert len(resources(nothing)) == 5
