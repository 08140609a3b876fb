"""Zips: the same bytes for the same files, and one that is written piece by piece."""

from __future__ import annotations

import io
import zipfile

from sagittal.server.export.zipping import EARLIEST, ZipSink, zip_files

FILES = {"b/two.csv": b"1,2\n" * 1000, "a.txt": "Übung".encode()}


def test_files_come_back_in_their_order_packed_and_without_a_date() -> None:
    packed = zip_files(FILES)
    archive = zipfile.ZipFile(io.BytesIO(packed))
    assert archive.namelist() == list(FILES)
    assert {name: archive.read(name) for name in FILES} == FILES
    assert {info.date_time for info in archive.infolist()} == {EARLIEST}
    assert len(packed) < 1000
    assert zip_files(dict(FILES)) == packed


def test_a_sink_hands_on_what_has_come_and_forgets_it() -> None:
    sink = ZipSink()
    assert sink.writable()
    assert sink.write(b"one") == 3
    assert sink.write(memoryview(b" two")) == 4
    assert sink.take() == b"one two"
    assert sink.take() == b""


def test_a_zip_can_be_sent_while_it_is_written() -> None:
    sink, sent = ZipSink(), []
    with zipfile.ZipFile(sink, "w") as archive:
        for name, content in FILES.items():
            archive.writestr(zipfile.ZipInfo(name, EARLIEST), content)
            sent.append(sink.take())
    sent.append(sink.take())
    assert all(sent)
    zip_file = zipfile.ZipFile(io.BytesIO(b"".join(sent)))
    assert {name: zip_file.read(name) for name in zip_file.namelist()} == FILES
