"""Files that a browser saves: their names, whatever they hold, and their types."""

from __future__ import annotations

from urllib.parse import unquote

import pytest

from sagittal.server.api.downloads.downloads import attachment, write_disposition


@pytest.mark.parametrize(
    ("name", "plain"),
    [
        ("walk.csv", "walk.csv"),
        ("two words.csv", "two words.csv"),
        ("a/b.csv", "a/b.csv"),
        ("Gänge.csv", "G_nge.csv"),
        ('a"; x="b.csv', "a_; x=_b.csv"),
        ("a\\b%2e.csv", "a_b_2e.csv"),
        ("a\r\nSet-Cookie: x.csv", "a__Set-Cookie: x.csv"),
        ("步态.csv", "__.csv"),
    ],
)
def test_a_name_stands_twice_plain_and_whole(name: str, plain: str) -> None:
    disposition = write_disposition(name)
    assert disposition.isascii()
    assert "\n" not in disposition
    first, _, whole = disposition.partition("; filename*=UTF-8''")
    assert first == f'attachment; filename="{plain}"'
    assert unquote(whole) == name
    assert not set(whole) & set("/ \"';")


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("a.json", "application/json"),
        ("a.b.csv", "text/csv; charset=utf-8"),
        ("a.parquet", "application/vnd.apache.parquet"),
        ("a.xlsx", "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"),
        ("a.zip", "application/zip"),
        ("a.html", "application/octet-stream"),  # never run by a browser
        ("json", "application/octet-stream"),
    ],
)
def test_the_type_is_that_of_the_ending(name: str, kind: str) -> None:
    answer = attachment(b"x", name)
    assert (answer.body, answer.headers["content-type"]) == (b"x", kind)
    assert answer.headers["content-disposition"] == write_disposition(name)


def test_a_type_that_is_said_holds() -> None:
    assert (
        attachment(b"", "a.csv", "application/octet-stream").headers["content-type"]
        == "application/octet-stream"
    )
