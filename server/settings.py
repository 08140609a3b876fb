"""Settings of an installation, read once at start from the command line and the environment, then immutable.

Every field `some_name` has the environment variable `SAGITTAL_SOME_NAME` (data_dir: `SAGITTAL_HOME`); the
command line takes precedence over the environment, and the environment over the defaults below:

    settings = load_settings({"port": 8080})        # from the command line; None = not given

Implemented without pydantic-settings because every process loads them: importing this module takes 0.04 s of
CPU time instead of 0.19 s, and the library would replace only sixty lines.
"""

from __future__ import annotations

import dataclasses
import ipaddress
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

MB = 1_000_000
_NODE_NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,31}")
_CLOCK = re.compile(r"([01]\d|2[0-3]):[0-5]\d")
_BUCKET = re.compile(r"(s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[A-Za-z0-9_][A-Za-z0-9._-]*)*)?")
BUCKET_DOMAIN = "s3://name or s3://name/prefix, of letters, digits, '.', '_' and '-'"
LOOPBACK = ("127.0.0.1", "localhost", "::1")
NODE_ADDRESS_DOMAIN = "http://host:port or https://host:port"
PROXY_DOMAIN = "addresses or networks of proxies, such as 172.16.0.0/12, and not all of the internet"


class SettingsError(ValueError):
    """A setting is outside its domain; the message names the setting, its value and the valid range."""


@dataclass(frozen=True)
class Settings:
    """Settings of one installation.

    Parameters
    ----------
    data_dir : folder of database, blobs and caches; created at first start, readable by its owner only.
    host, port : address the web server listens on.
    allowed_hosts : host names accepted in `Host` besides loopback (protects against DNS rebinding).
    behind_tls : a reverse proxy terminates TLS: cookies are `Secure`, any address may be bound.
    trusted_proxies : addresses and networks whose X-Forwarded-For and -Proto are trusted, so that throttles
        count clients and not the proxy; with `behind_tls`, loopback is always trusted.
    max_connections : simultaneous connections, bounded by the system's limit on open files.
    max_file_bytes, max_set_bytes, max_files : limits of one upload and of one recording's upload set.
    min_free_bytes : free disk space below which uploads are rejected.
    workers : worker processes started by `sagittal serve`; each has one pre-warmed child.
    live_workers : processes that analyse live trials, many each; 0 = trials are recorded only.
    lease_s : time without renewal after which a worker is considered dead; renewed every third of it.
    job_timeout_s : maximum run time of a job, or of the part since its last checkpoint.
    child_memory_bytes : address space of the computing child (RLIMIT_AS; libraries alone map 1 GB), 0 = none.
    sweep_grace_s : age after which an unreferenced file is moved to the trash.
    idle_minutes, absolute_hours : lifetime of a sign-in, idle and total.
    backup_dir : folder outside the data folder for the backups of `sagittal serve`, "" = no backups.
    backup_at : time of the daily backup, HH:MM in local time.
    backup_key : file with the key that encrypts them (`sagittal keygen`), "" = they are not encrypted.
    identity_key : file with the key that encrypts patients' names (`sagittal identity-key`), "" = in data_dir
    retention_years : patients without a visit for longer are listed on the System page, 0 = off.
    log_format : "text" or "json", one object per line including one for each request.
    database_url : a PostgreSQL database instead of the file in the data folder, as
        postgresql://user:password@host:port/database; omitted parts, such as the password, are taken from
        libpq's usual sources (PGPASSFILE). "" = the file.
    bucket : S3-compatible object store used instead of the data folder: s3://name or s3://name/prefix.
        Endpoint, region and keys come from the standard variables (AWS_ENDPOINT_URL, AWS_REGION,
        AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY). "" = the folder.
    node_name, node_address : of this web server if several share one PostgreSQL database: the name is
        permanent and names its folder; the others reach it at the address. "" = single server.
    task_modules : modules whose import registers kinds of jobs and their displays.
    """

    data_dir: Path = field(default_factory=lambda: Path.home() / ".sagittal")
    host: str = "127.0.0.1"
    port: int = 8000
    allowed_hosts: tuple[str, ...] = ()
    behind_tls: bool = False
    trusted_proxies: tuple[str, ...] = ()
    max_connections: int = 1000
    max_file_bytes: int = 500 * MB
    max_set_bytes: int = 1000 * MB
    max_files: int = 200
    min_free_bytes: int = 200 * MB
    workers: int = 1
    live_workers: int = 1
    lease_s: float = 15.0
    job_timeout_s: float = 1800.0
    child_memory_bytes: int = 8000 * MB
    sweep_grace_s: float = 3600.0
    idle_minutes: float = 15.0
    absolute_hours: float = 12.0
    backup_dir: str = ""
    backup_at: str = "02:30"
    backup_key: str = ""
    identity_key: str = ""
    retention_years: int = 0
    log_format: str = "text"
    database_url: str = field(default="", repr=False)
    bucket: str = ""
    node_name: str = ""
    node_address: str = ""
    task_modules: tuple[str, ...] = ("sagittal.server.worker.tasks", "sagittal.server.viewer.recorded_walk")

    def __post_init__(self) -> None:
        _require(0 <= self.port <= 65535, "port", self.port, "0 to 65535 (0 = any free port)")
        for name in ("workers", "live_workers"):
            _require(getattr(self, name) >= 0, name, getattr(self, name), "0 or more")
        for name in ("lease_s", "job_timeout_s", "idle_minutes", "absolute_hours"):
            _require(getattr(self, name) > 0, name, getattr(self, name), "more than 0")
        for name in ("max_connections", "max_file_bytes", "max_set_bytes", "max_files"):
            _require(getattr(self, name) >= 1, name, getattr(self, name), "1 or more")
        for name in ("min_free_bytes", "child_memory_bytes", "sweep_grace_s"):
            _require(getattr(self, name) >= 0, name, getattr(self, name), "0 or more")
        for proxy in self.trusted_proxies:
            _require(_is_some_network(proxy), "trusted_proxies", f"'{proxy}'", PROXY_DOMAIN)
        years = self.retention_years
        _require(0 <= years <= 200, "retention_years", years, "0 to 200 (0 = no list)")
        _require(_CLOCK.fullmatch(self.backup_at) is not None, "backup_at", f"'{self.backup_at}'", "HH:MM")
        _require(self.log_format in {"text", "json"}, "log_format", f"'{self.log_format}'", "text or json")
        _require(not self.data_dir.is_file(), "data_dir", f"'{self.data_dir}', a file", "a folder")
        if self.database_url and not self.database_url.startswith("postgresql://"):
            # the value is not repeated, as it may contain a password
            raise SettingsError("database_url is no postgresql://user:password@host:port/database.")
        self._check_node()
        _require(_BUCKET.fullmatch(self.bucket) is not None, "bucket", f"'{self.bucket}'", BUCKET_DOMAIN)
        for name in ("backup_dir", "backup_key", "identity_key"):
            path = getattr(self, name)
            _require(not path or Path(path).is_absolute(), name, f"'{path}'", "a path from the root, /…")
        if self.backup_dir and Path(self.backup_dir).resolve().is_relative_to(self.data_dir.resolve()):
            raise SettingsError(
                f"backup_dir is '{self.backup_dir}', inside the data folder: a backup would be lost with it. "
                "Give a folder on another disk or computer."
            )

    def _check_node(self) -> None:
        name, address = self.node_name, self.node_address
        if not name and not address:
            return
        if not (name and address):
            raise SettingsError(
                "Of SAGITTAL_NODE_NAME and SAGITTAL_NODE_ADDRESS one is missing: a web server among several "
                "needs both, one that serves alone none."
            )
        _require(
            _NODE_NAME.fullmatch(name) is not None, "node_name", f"'{name}'", "a-z, 0-9 and -, at most 32"
        )
        _require(_is_origin(address), "node_address", f"'{address}'", NODE_ADDRESS_DOMAIN)
        if not self.database_url:
            raise SettingsError(
                f"node_name is '{name}', but the database is a file, which one web server has for itself. "
                "Several need PostgreSQL: set SAGITTAL_DATABASE_URL."
            )

    def require_private_traffic(self) -> None:
        """Raise SettingsError if the web server would listen on a network without TLS."""
        if self.host not in LOOPBACK and not self.behind_tls:
            raise SettingsError(
                f"host is '{self.host}': patients' data would cross the network unencrypted. Put a TLS proxy "
                "in front and set SAGITTAL_BEHIND_TLS=1, or listen on 127.0.0.1."
            )

    def make_public_address(self, port: int) -> str:
        """Return the URL at which a browser reaches the web server on a port.

        Behind TLS it is the first allowed host. An unspecified host (0.0.0.0, ::) is reached as localhost.
        """
        if self.behind_tls and self.allowed_hosts:
            return f"https://{self.allowed_hosts[0]}"
        host = "localhost" if _is_unspecified(self.host) else self.host
        return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"

    @property
    def secure_cookies(self) -> bool:
        """Whether cookies carry `Secure` (browsers drop those on plain http)."""
        return self.behind_tls

    @property
    def hosts(self) -> tuple[str, ...]:
        """All accepted host names."""
        return (*LOOPBACK, *self.allowed_hosts)

    @property
    def proxies(self) -> tuple[str, ...]:
        """All trusted proxies."""
        return ("127.0.0.1", "::1", *self.trusted_proxies) if self.behind_tls else self.trusted_proxies

    @property
    def database(self) -> Path:
        """The SQLite file, used where no database_url is set."""
        return self.data_dir / "sagittal.db"

    @property
    def database_source(self) -> Path | str:
        """Location of the database: the SQLite file or the URL of PostgreSQL."""
        return self.database_url or self.database

    @property
    def blobs(self) -> Path:
        """Folder of the content-addressed files, including those awaiting upload to a bucket."""
        return self.data_dir / "blobs"

    @property
    def nodes(self) -> Path:
        """Folder with a subfolder for each named web server, and their shared key."""
        return self.data_dir / "nodes"

    @property
    def node_folder(self) -> Path:
        """Folder that only this web server writes."""
        return self.nodes / self.node_name if self.node_name else self.data_dir

    @property
    def node_key(self) -> Path:
        """Key with which web servers authenticate each other (server/nodes/passage.py)."""
        return self.nodes / "key"

    @property
    def live(self) -> Path:
        """Folder of this web server's logs of live trials that have not become recordings yet."""
        return self.node_folder / "live"

    @property
    def live_folders(self) -> list[Path]:
        """Live-trial folders of all web servers; some may not exist."""
        return [self.data_dir / "live", *sorted(self.nodes.glob("*/live"))]

    @property
    def trash(self) -> Path:
        """Folder of unreferenced stored files (storage/trash.py)."""
        return self.data_dir / "trash"

    @property
    def erasing(self) -> Path:
        """Folder of records of erasures in progress, so that interrupted ones are finished."""
        return self.data_dir / "erasing"

    @property
    def mark(self) -> Path:
        """File with the last sequence number of the audit log (storage/high_water.py)."""
        return self.data_dir / "audit.mark"

    @property
    def cache(self) -> Path:
        """Folder of compiled kernels; may be deleted at any time."""
        return self.data_dir / "cache"

    @property
    def backups(self) -> Path:
        """Folder of database copies made before upgrades, and of temporary files of a backup."""
        return self.data_dir / "backups"

    @property
    def backup_state(self) -> Path:
        """File with the outcome of the last backup and the last restore test."""
        return self.data_dir / "backup.json"

    @property
    def restoring(self) -> Path:
        """Folder in which a restore is staged until it has been verified."""
        return self.data_dir / "restoring"

    @property
    def second_factor_key(self) -> Path:
        """Key that decrypts the secrets of second factors (server/auth/second_factor.py)."""
        return self.data_dir / "second-factor.key"

    @property
    def identity_key_file(self) -> Path:
        """Key that decrypts names and addresses of patients (storage/field_cipher.py)."""
        return Path(self.identity_key) if self.identity_key else self.data_dir / "identity.key"

    @property
    def lock(self) -> Path:
        """Lock file of a running server on this data folder, held as a shared lock."""
        return self.data_dir / "server.lock"

    @property
    def node_lock(self) -> Path:
        """Lock file held exclusively by one of several web servers."""
        return self.node_folder / "server.lock"

    @property
    def workers_lock(self) -> Path:
        """Lock file shared by all workers of this data folder; held exclusively while its content is
        moved.
        """
        return self.data_dir / "workers.lock"

    def environment(self) -> dict[str, str]:
        """These settings as environment variables for child processes."""
        return {_variable(f.name): _text(getattr(self, f.name)) for f in dataclasses.fields(self)}


def load_settings(
    options: Mapping[str, object] | None = None, environment: Mapping[str, str] | None = None
) -> Settings:
    """Merge command line (None = not given), environment and defaults.

    Raises
    ------
    SettingsError
        a value cannot be read or is outside its domain.
    """
    env = os.environ if environment is None else environment
    values: dict[str, object] = {}
    for f in dataclasses.fields(Settings):
        text = env.get(_variable(f.name))
        if text is not None:
            values[f.name] = _parse(f.name, str(f.type), text)
    values |= {name: value for name, value in (options or {}).items() if value is not None}
    if "data_dir" in values:
        values["data_dir"] = Path(str(values["data_dir"])).expanduser().absolute()
    return Settings(**values)  # type: ignore[arg-type]


def _variable(name: str) -> str:
    return "SAGITTAL_HOME" if name == "data_dir" else f"SAGITTAL_{name.upper()}"


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "1" if value else "0"
    return ",".join(value) if isinstance(value, tuple) else str(value)


def _parse(name: str, kind: str, text: str) -> object:
    try:
        match kind:
            case "int":
                return int(text)
            case "float":
                return float(text)
            case "bool":
                return {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}[
                    text.lower()
                ]
            case "tuple[str, ...]":
                return tuple(part.strip() for part in text.split(",") if part.strip())
            case _:
                return text
    except (ValueError, KeyError):
        raise SettingsError(f"{_variable(name)} is '{text}', expected {kind}.") from None


def _is_some_network(text: str) -> bool:
    """Whether the text is a network smaller than all addresses; trusting all would let clients forge
    theirs.
    """
    try:
        return ipaddress.ip_network(text).prefixlen > 0
    except ValueError:
        return False


def _is_unspecified(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False


def _is_origin(text: str) -> bool:
    try:
        url = urlsplit(text)
        return (
            url.scheme in {"http", "https"}
            and bool(url.hostname)
            and (url.port or 0) > 0
            and (f"{url.scheme}://{url.netloc}" == text and url.username is None)
        )
    except ValueError:
        return False


def _require(ok: bool, name: str, value: object, domain: str) -> None:
    if not ok:
        raise SettingsError(f"{name} is {value}, expected {domain}.")
