"""Zip and gzip: what is accepted, what is refused and that real bytes are counted."""

from __future__ import annotations

import gzip
import io
import stat
import struct
import zipfile
from pathlib import Path

import pytest

from sagittal.core.errors import ArchiveError
from sagittal.core.formats import ArchiveLimits, SourceFile, expand, read_recording
from tests.core.formats.making import mt_file, zipped


def refuse(data: bytes, code: str, limits: ArchiveLimits | None = None, name: str = "take.zip") -> str:
    with pytest.raises(ArchiveError) as e:
        [member.read() for member in expand([SourceFile.of_bytes(name, data)], limits)]
    assert e.value.code == code
    return e.value.message


def test_a_zipped_folder_reads_like_its_files() -> None:
    files = [mt_file("00B40B91"), mt_file("00B40C44", seed=1)]
    data = zipped({f"Mé 🦶/{f.name}": f.read() for f in files} | {"__MACOSX/._x": b"junk", "Mé 🦶/": b""})
    packed = read_recording([SourceFile.of_bytes("take 🦵.zip", data)])
    plain = read_recording(files)
    assert [s.digest for s in packed.streams.values()] == [s.digest for s in plain.streams.values()]
    assert packed.streams["00B40B91"].source == "Mé 🦶/take_00B40B91.txt"


def test_members_are_read_only_when_asked() -> None:
    broken = bytearray(zipped({"a.txt": b"a" * 100, "b.txt": b"b" * 100}, zipfile.ZIP_STORED))
    broken[broken.index(b"b" * 100) + 5] = 0
    a, b = expand([SourceFile.of_bytes("take.zip", bytes(broken))])
    assert a.read() == b"a" * 100
    with pytest.raises(ArchiveError, match="damaged"):
        b.read()


@pytest.mark.slow
def test_a_bomb_is_refused_before_it_is_unpacked() -> None:
    data = zipped({"bomb.txt": b"0" * 50_000_000})
    assert len(data) < 100_000
    assert "times" in refuse(data, "zip_bomb")


def test_many_members_that_pack_too_much_together_are_refused() -> None:
    refuse(zipped({f"{i}.txt": bytes(1000) for i in range(30)}), "zip_bomb", ArchiveLimits(total=20_000))


def test_too_many_entries_are_refused() -> None:
    refuse(zipped({f"{i}": b"" for i in range(1001)}), "zip_bomb")


def test_a_directory_that_lies_about_the_size_cannot_give_more_bytes() -> None:
    data = bytearray(zipped({"a.txt": bytes(range(256)) * 4000}))
    at = data.index(b"PK\x01\x02") + 24
    data[at : at + 4] = struct.pack("<I", 1000)
    refuse(bytes(data), "zip_bad")


@pytest.mark.parametrize("name", ["/etc/passwd", "../up.txt", "a/../../b.txt", "C:/x.txt", "..\\up.txt"])
def test_paths_that_lead_out_are_refused(name: str) -> None:
    assert name.split("/")[0].split("\\")[0] in refuse(zipped({name: b"x"}), "zip_traversal")


def test_a_link_is_refused() -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as z:
        info = zipfile.ZipInfo("link.txt")
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        z.writestr(info, "/etc/passwd")
    refuse(out.getvalue(), "zip_link")


def test_a_password_is_refused() -> None:
    data = bytearray(zipped({"a.txt": b"secret"}))
    data[data.index(b"PK\x01\x02") + 8] |= 1
    refuse(bytes(data), "zip_encrypted")


@pytest.mark.parametrize(
    "inner", [zipped({"a.txt": b"x"}), gzip.compress(b"x" * 100, mtime=0)], ids=["zip", "gzip"]
)
def test_archives_inside_archives_are_refused(inner: bytes) -> None:
    refuse(zipped({"inner.txt": inner}), "zip_nested")
    refuse(gzip.compress(inner), "zip_nested", name="x.gz")


def test_damage_is_refused_wherever_it_is() -> None:
    data = zipped({"a.txt": bytes(range(256)) * 40})
    for cut in range(4, len(data), 23):
        refuse(data[:cut], "zip_bad")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("a.txt", bytes(range(256)) * 40)
    broken = bytearray(packed.getvalue())
    broken[60:70] = bytes(10)
    refuse(bytes(broken), "zip_bad")


def test_a_gzip_bomb_and_a_cut_gzip_are_refused() -> None:
    refuse(gzip.compress(bytes(20_000_000)), "zip_bomb", name="a.gz")
    whole = gzip.compress(bytes(range(256)) * 100)
    for cut in (11, len(whole) // 2, len(whole) - 3):
        refuse(whole[:cut], "zip_bad", name="a.gz")


def test_a_gzip_of_several_parts_is_joined() -> None:
    (file,) = expand([SourceFile.of_bytes("a.txt.gz", gzip.compress(b"one ") + gzip.compress(b"two"))])
    assert (file.name, file.read()) == ("a.txt", b"one two")


def test_plain_files_pass_unread() -> None:
    def never() -> bytes:
        raise AssertionError

    (file,) = expand([SourceFile("a.txt", 5, never)])
    assert file.name == "a.txt"


def test_a_file_on_disk_is_read_on_demand(tmp_path: Path) -> None:
    path = tmp_path / "a 👟.txt"
    path.write_bytes(b"abc")
    file = SourceFile.of_path(path)
    assert (file.name, file.size, file.read()) == ("a 👟.txt", 3, b"abc")
