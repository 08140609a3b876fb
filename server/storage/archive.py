"""Streaming tar archives, encrypted with age if a key is given.

    with fs.IncomingFile(folder) as file:
        with write_archive(file, key) as archive:
            archive.add("a/b", source, size)
        file.keep(target)
    for name, size, content in read_archive(target, key): ...

Encrypted files are of the format age-encryption.org/v1 (X25519, ChaCha20-Poly1305 in pieces of 64 KiB, each
authenticated, and the end too), so `age --decrypt` opens them without this program. Memory does not grow with
the archive.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tarfile
import threading
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, BinaryIO, Final, Protocol

import pyrage

from sagittal.core.message import Message
from sagittal.server.storage import fs

PIECE: Final = 1 << 20
_MAGIC: Final = b"age-encryption.org/"
_SECRET: Final = "AGE-SECRET-KEY-1"  # noqa: S105 - how a private key of age begins


class BackupFileError(Exception):
    """The archive or its key cannot be used; the message gives reason and remedy."""


class Sink(Protocol):
    """Output of an archive."""

    def write(self, data: bytes) -> object:
        """Write all of the bytes."""


@dataclass(frozen=True)
class ClinicKey:
    """The clinic's age key pair.

    Parameters
    ----------
    public : for encryption. private : for decryption; None = stored elsewhere.
    """

    public: pyrage.x25519.Recipient
    private: pyrage.x25519.Identity | None

    @property
    def opens(self) -> bool:
        """Whether it includes the private key required for decryption."""
        return self.private is not None


def make_key(path: Path) -> str:
    """Write a new key pair, readable by its owner only; return the public one; BackupFileError if it
    exists.
    """
    if path.exists():
        raise BackupFileError(Message("{path} exists; an existing key is never overwritten.", path=path))
    private = pyrage.x25519.Identity.generate()
    public = str(private.to_public())
    fs.write_file(path, f"# public key: {public}\n{private}\n".encode())
    return public


def read_key(path: Path) -> ClinicKey:
    """Read a private age key, or a public one (age1…) for encryption only; # starts a comment.

    Raises
    ------
    BackupFileError
        the file does not exist or contains no key.
    """
    try:
        lines = [line.strip() for line in path.read_text("utf-8").splitlines()]
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise BackupFileError(f"The key {path} cannot be read ({reason}).") from error
    text = next((line for line in lines if line and not line.startswith("#")), "")
    try:
        if text.startswith(_SECRET):
            private = pyrage.x25519.Identity.from_str(text)
            return ClinicKey(private.to_public(), private)
        return ClinicKey(pyrage.x25519.Recipient.from_str(text), None)
    except (pyrage.IdentityError, pyrage.RecipientError) as error:
        raise BackupFileError(
            f"{path} holds no key. Expected a line AGE-SECRET-KEY-1… or age1…; `sagittal keygen FILE` makes "
            "one."
        ) from error


class ArchiveWriter:
    """An archive being written."""

    def __init__(self, tar: tarfile.TarFile) -> None:
        self._tar = tar

    def add(self, name: str, source: BinaryIO, size: int) -> str:
        """Append the first `size` bytes of a source and return their sha256."""
        member = tarfile.TarInfo(name)
        member.size, member.mode = size, 0o600
        reader = _HashingReader(source)
        self._tar.addfile(member, reader)  # type: ignore[arg-type]
        self._tar.members = []  # type: ignore[attr-defined]  # it would remember each for ever
        return reader.sha256


class ArchivedFile:
    """Content of one file of an archive being read."""

    def __init__(self, content: IO[bytes], archive: Path) -> None:
        self._content, self._archive = content, archive

    def read(self, size: int) -> bytes:
        """The next bytes, empty at the end; raises BackupFileError if the archive is truncated."""
        try:
            return self._content.read(size)
        except (tarfile.TarError, EOFError) as error:
            raise _damaged(self._archive) from error


@contextlib.contextmanager
def write_archive(sink: Sink, key: ClinicKey | None = None) -> Iterator[ArchiveWriter]:
    """Context that writes an archive to a sink; complete only if it ends without an error."""
    if key is None:
        with tarfile.open(fileobj=sink, mode="w|", format=tarfile.PAX_FORMAT) as tar:  # type: ignore[call-overload]
            yield ArchiveWriter(tar)
        return
    public = key.public
    read_end, write_end = os.pipe()
    source, counting = os.fdopen(read_end, "rb"), _Counting(sink)
    worker = _Background(lambda: pyrage.encrypt_io(source, counting, [public]), source)
    try:
        with (
            os.fdopen(write_end, "wb", buffering=PIECE) as pipe,
            tarfile.open(fileobj=pipe, mode="w|", format=tarfile.PAX_FORMAT) as tar,
        ):
            yield ArchiveWriter(tar)
    except BaseException:
        worker.end()
        if counting.error is not None:  # cause of the broken pipe
            raise counting.error from None
        raise
    worker.end()
    if worker.error is not None:
        raise counting.error or worker.error


def read_archive(path: Path, key: ClinicKey | None) -> Generator[tuple[str, int, ArchivedFile], None, None]:
    """Yield name, size in bytes and content of every file in order; read the content before the next file.

    Raises
    ------
    BackupFileError
        not an archive, damaged, truncated, or encrypted with another key. Detected at the end at the latest:
        do not use any content before.
    """
    with path.open("rb") as file:
        encrypted = file.read(len(_MAGIC)) == _MAGIC
        file.seek(0)
        if not encrypted:
            yield from _members(path, file)
            return
        if key is None or key.private is None:
            raise BackupFileError(
                f"{path.name} is encrypted; give the file with the private key (--key FILE)."
            )
        yield from _decrypted(path, file, key.private)


def _decrypted(
    path: Path, file: BinaryIO, private: pyrage.x25519.Identity
) -> Generator[tuple[str, int, ArchivedFile], None, None]:
    read_end, write_end = os.pipe()
    sink = os.fdopen(write_end, "wb", buffering=PIECE)
    worker = _Background(lambda: pyrage.decrypt_io(file, sink, [private]), sink)
    pipe = os.fdopen(read_end, "rb", buffering=PIECE)
    try:
        yield from _members(path, pipe)
        while pipe.read(PIECE):  # padding of the tar: the end is authenticated too
            pass
    except GeneratorExit:
        pipe.close()
        worker.end()
        raise
    except BackupFileError as error:
        pipe.close()
        worker.end()
        raise _refused(path, worker.error) from error
    pipe.close()
    worker.end()
    if worker.error is not None:
        raise _refused(path, worker.error)


def _refused(path: Path, error: BaseException | None) -> BackupFileError:
    if isinstance(error, pyrage.DecryptError):
        return BackupFileError(f"{path.name} was encrypted for another key ({error}). Give the clinic's own.")
    return _damaged(path)


def _damaged(path: Path) -> BackupFileError:
    return BackupFileError(f"{path.name} is damaged or was cut; use another backup.")


def _members(path: Path, file: BinaryIO) -> Generator[tuple[str, int, ArchivedFile], None, None]:
    try:
        with tarfile.open(fileobj=file, mode="r|") as tar:
            while (member := tar.next()) is not None:
                tar.members = []  # type: ignore[attr-defined]  # it would remember each for ever
                # zeros of a sparse file cost nothing: a few bytes could fill the disk
                is_file = member.isreg() and not member.issparse()
                content = tar.extractfile(member) if is_file else None
                if content is None:
                    raise BackupFileError(
                        f"{path.name} holds {member.name}, which is no file; it is not ours."
                    )
                yield member.name, member.size, ArchivedFile(content, path)
    except (tarfile.TarError, EOFError, ValueError) as error:  # ValueError: a header with invalid numbers
        raise _damaged(path) from error


class _HashingReader:
    """Reader that hashes the data passing through."""

    def __init__(self, source: BinaryIO) -> None:
        self._source, self._hash = source, hashlib.sha256()

    def read(self, size: int) -> bytes:
        data = self._source.read(size)
        self._hash.update(data)
        return data

    @property
    def sha256(self) -> str:
        return self._hash.hexdigest()


class _Counting:
    """Sink that returns the number of bytes written, as age requires."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self.error: OSError | None = None  # age's own error does not identify it

    def write(self, data: bytes) -> int:
        try:
            self._sink.write(data)
        except OSError as error:
            self.error = error
            raise
        return len(data)

    def flush(self) -> None:
        """No-op, as nothing is buffered."""


class _Background:
    """Thread that runs `work` and then closes its end of a pipe."""

    def __init__(self, work: Callable[[], object], end: BinaryIO) -> None:
        self.error: BaseException | None = None
        self._work, self._end_of_pipe = work, end
        self._thread = threading.Thread(target=self._run, name="age", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Wait for the thread."""
        self._thread.join()

    def _run(self) -> None:
        try:
            self._work()
        except BaseException as error:  # noqa: BLE001 - told by whoever waits
            self.error = error
        finally:
            with contextlib.suppress(OSError):  # the other end may already be closed
                self._end_of_pipe.close()
