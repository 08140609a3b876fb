"""A bucket that is away, refuses or was never set up: an error in seconds, one sentence at a start."""

from __future__ import annotations

import os
import pickle
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from sagittal.server.settings import Settings, SettingsError, load_settings
from sagittal.server.storage.files import blob_bucket, s3_bucket
from sagittal.server.storage.files.blob_bucket import BucketBlobs
from sagittal.server.storage.files.blob_opening import open_blobs, require_use
from sagittal.server.storage.files.blobs import BlobFile, BlobStore, StoreAway
from tests.data import ROOT
from tests.helpers.buckets import KEYS, Bucket, bucket, s3_server  # noqa: F401 - fixtures

SPACE, NAME = "a" * 32, "b" * 64
CALLS: dict[str, Callable[[BlobStore], object]] = {
    "put": lambda b: b.put(SPACE, b"walk"),
    "read": lambda b: b.read(SPACE, NAME),
    "open": lambda b: b.open(SPACE, NAME),
    "read_part": lambda b: b.read_part(SPACE, NAME, 0, 9),
    "require": lambda b: b.require(SPACE, NAME),
    "is_older": lambda b: b.is_older(BlobFile(SPACE, NAME, 0.0), 0.0),
    "remove": lambda b: b.remove(SPACE, NAME),
    "erase": lambda b: b.erase(SPACE),
    "files": lambda b: list(b.files()),
    "trash": lambda b: list(b.trash.files()),
    "probe": lambda b: b.probe(),
}


@pytest.fixture
def blobs(bucket: Bucket, tmp_path: Path) -> BucketBlobs:  # noqa: F811
    return BucketBlobs(bucket.url, tmp_path / "incoming")


def why_away(call: Callable[[], object]) -> StoreAway:
    with pytest.raises(StoreAway) as caught:
        call()
    return caught.value


# the library's own patience is three minutes
@pytest.mark.slow
@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", CALLS)
def test_a_store_that_is_away_says_so_within_seconds(
    blobs: BucketBlobs,
    bucket: Bucket,  # noqa: F811
    name: str,
) -> None:
    bucket.server.stop()
    error = why_away(lambda: CALLS[name](blobs))
    assert (error.status, error.code, error.refuses) == (503, "store_away", False)
    assert pickle.loads(pickle.dumps(error)).detail == error.detail  # noqa: S301 - our own
    assert list(blobs.incoming.iterdir()) == []
    bucket.server.start()
    assert list(blobs.files()) == []  # nothing was acknowledged, nothing is there


@pytest.fixture
def silent(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An endpoint that takes every connection and never answers."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{listener.getsockname()[1]}")
        monkeypatch.setattr(blob_bucket, "SILENCE_S", 0.5)
        monkeypatch.setattr(blob_bucket, "BRIEF_S", 0.3)
        yield


@pytest.mark.slow
@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", CALLS)
@pytest.mark.usefixtures("bucket", "silent")
def test_a_store_that_never_answers_is_away(tmp_path: Path, name: str) -> None:
    target = BucketBlobs("s3://clinic", tmp_path / "incoming")
    assert why_away(lambda: CALLS[name](target)).code == "store_away"


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in CALLS if name not in {"require", "is_older"}])
@pytest.mark.usefixtures("bucket")
def test_a_bucket_that_is_not_there_refuses_and_no_file_is_taken_for_missing(
    tmp_path: Path, name: str
) -> None:
    error = why_away(lambda: CALLS[name](BucketBlobs("s3://nobodys", tmp_path / "incoming")))
    assert error.refuses
    assert "NoSuchBucket" in error.detail


def test_nobody_waits_again_for_a_store_that_was_just_found_away(
    blobs: BucketBlobs,
    bucket: Bucket,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(s3_bucket, "REST_S", 3600.0)
    bucket.server.stop()
    why_away(lambda: blobs.read(SPACE, NAME))
    bucket.server.start()
    blobs.probe()  # a monitor looks for itself
    assert why_away(lambda: blobs.put(SPACE, b"walk")).code == "store_away"
    assert bucket.objects() == set()
    blobs._bucket._away = ("", 0.0)  # an hour later
    blobs.put(SPACE, b"walk")


def test_a_put_is_acknowledged_only_when_the_bucket_has_it(
    blobs: BucketBlobs,
    bucket: Bucket,  # noqa: F811
) -> None:
    with blobs.receive(SPACE) as receiver:
        receiver.write(b"walk")
        bucket.server.stop()
        why_away(receiver.keep)
        bucket.server.start()
        blob = receiver.keep()  # asked again, it is kept
    assert bucket.objects() == {f"blobs/{SPACE}/{blob.sha256}"}
    assert list(blobs.incoming.iterdir()) == []


def test_wrong_keys_are_one_sentence_at_the_start(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
) -> None:
    settings = Settings(data_dir=tmp_path, bucket=bucket.url)
    require_use(open_blobs(settings))
    bucket.server.ask("POST", "/moto-api/reset-auth", b"0")
    try:
        with pytest.raises(SettingsError, match=r"cannot be used \(.*Check SAGITTAL_BUCKET") as caught:
            require_use(open_blobs(settings))
    finally:
        bucket.server.ask("POST", "/moto-api/reset-auth", b"inf")
    assert "\n" not in str(caught.value)
    bucket.server.stop()
    require_use(open_blobs(settings))  # it may come back: no reason not to start


def test_no_keys_at_all_refuse(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in KEYS:
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_METADATA_ENDPOINT", "http://127.0.0.1:1")  # nobody asks the network of a cloud
    target = BucketBlobs(bucket.url, tmp_path / "incoming")
    assert why_away(target.probe).refuses


def test_a_bucket_with_versions_is_warned_of(
    bucket: Bucket,  # noqa: F811
    blobs: BucketBlobs,
    caplog: pytest.LogCaptureFixture,
) -> None:
    require_use(blobs)
    assert "versions" not in caplog.text
    on = b'<VersioningConfiguration xmlns="http://s3.amazonaws.com/doc/2006-03-01/"><Status>Enabled</Status>'
    bucket.server.ask("PUT", f"/{bucket.name}?versioning", on + b"</VersioningConfiguration>")
    require_use(blobs)
    assert "keeps versions" in caplog.text


@pytest.mark.parametrize(
    ("endpoint", "allowed", "fine"),
    [
        ("http://10.0.0.5:9000", None, False),
        ("http://minio.clinic.example", None, False),
        ("http://10.0.0.5:9000", "true", True),
        ("http://localhost:9000", None, True),
        ("https://minio.clinic.example", None, True),
    ],
)
def test_files_do_not_cross_the_network_unencrypted_by_accident(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    endpoint: str,
    allowed: str | None,
    fine: bool,
) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
    if allowed:
        monkeypatch.setenv("AWS_ALLOW_HTTP", allowed)
    if fine:
        BucketBlobs(bucket.url, tmp_path / "incoming")
    else:
        with pytest.raises(SettingsError, match="unencrypted"):
            BucketBlobs(bucket.url, tmp_path / "incoming")


@pytest.mark.parametrize(
    "url", ["clinic", "s3://", "s3://A", "s3://clinic/../other", "s3://clinic/", "https://clinic/x"]
)
def test_a_bucket_is_named_by_its_url(url: str) -> None:
    with pytest.raises(SettingsError, match=r"bucket is '.*', expected s3://name"):
        load_settings({}, {"SAGITTAL_BUCKET": url})


def test_without_the_library_the_start_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "obstore", None)
    with pytest.raises(SettingsError, match=r"pip install 'sagittal\[s3\]'"):
        open_blobs(Settings(data_dir=tmp_path, bucket="s3://clinic"))


def test_a_command_with_another_setting_than_the_files_is_refused(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
) -> None:
    place, target = Settings(data_dir=tmp_path), Settings(data_dir=tmp_path, bucket=bucket.url)
    blob = open_blobs(place).put(SPACE, b"walk")
    with pytest.raises(SettingsError, match="Run `sagittal move-blobs` first"):
        open_blobs(target)
    open_blobs(place).remove(SPACE, blob.sha256)
    open_blobs(target).put(SPACE, b"walk")
    for second in (place, Settings(data_dir=tmp_path, bucket="s3://another")):
        with pytest.raises(SettingsError, match=f"Set SAGITTAL_BUCKET={bucket.url}"):
            open_blobs(second)


@pytest.mark.slow
def test_a_server_does_not_start_on_a_bucket_that_is_not_there(
    bucket: Bucket,  # noqa: F811
    tmp_path: Path,
) -> None:
    environment = {**os.environ, "SAGITTAL_BUCKET": "s3://nobodys"}
    started = subprocess.run(
        [
            sys.executable, "-m", "sagittal.server.main",
            "serve", "--data", str(tmp_path / "home"), "--port", "0",
        ],
        capture_output=True, text=True, check=False, timeout=120, cwd=ROOT, env=environment,
    )  # fmt: skip
    assert started.returncode == 1
    assert "Traceback" not in started.stderr
    assert started.stderr.splitlines()[-1].startswith("s3://nobodys cannot be used (NoSuchBucket")


def test_objects_of_others_are_passed_over(bucket: Bucket, blobs: BucketBlobs) -> None:  # noqa: F811
    for key in ("readme", f"blobs/{SPACE}/notes.txt", f"blobs/{SPACE}/{NAME}/deeper", "trash/x", "blobs/x/y"):
        bucket.write(key, b"theirs")
    assert list(blobs.files()) == []
    assert list(blobs.trash.files()) == []
    assert not blobs.is_empty()
