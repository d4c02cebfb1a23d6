# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""How a server is reached, and as which user."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import re
import ssl
import stat
import threading
from typing import Any, Optional, Union

import grpc

from .errors import InvalidInput, NotFound, Unauthenticated

# As those of the C++ client: a drag may rest for minutes, and must not wait long for a server that is back.
_OPTIONS = [
    ("grpc.max_receive_message_length", 256 << 20),
    ("grpc.keepalive_time_ms", 30_000),
    ("grpc.enable_http_proxy", 0),
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 2_000),
    ("grpc.dns_min_time_between_resolutions_ms", 100),
    ("grpc.use_local_subchannel_pool", 1),
]
_MAX_TOKEN_BYTES = 16 << 10
_TOKEN = re.compile(r"[A-Za-z0-9._~+/=-]+")
_LOOPBACK = re.compile(r"(localhost|\[::1\]|127\.\d{1,3}\.\d{1,3}\.\d{1,3}):\d+")

_AUTHORITIES_OF_LINUX = ("/etc/ssl/certs/ca-certificates.crt", "/etc/pki/tls/certs/ca-bundle.crt", "/etc/ssl/ca-bundle.pem")

PathLike = Union[str, "os.PathLike[str]"]


@dataclasses.dataclass(frozen=True)
class Tls:
    """Files in PEM. `ca`: authorities of the server's certificate (left out: the system's). `certificate` and `key`: the client's
    own, for servers that ask for one."""

    ca: Optional[PathLike] = None
    certificate: Optional[PathLike] = None
    key: Optional[PathLike] = None


class Token:
    """A token, or a file with one that is read again when it is renewed. Thread-safe. Never printed."""

    def __init__(self, token: Optional[str], file: Optional[PathLike]) -> None:
        if token is not None and file is not None:
            raise InvalidInput("there are token and token_file: give one of them")
        self._file = None if file is None else pathlib.Path(file)
        self._lock = threading.Lock()
        self._written = 0
        self._token = _checked(token, "token") if token is not None else ""
        if self._file is not None:
            self._read()

    def __bool__(self) -> bool:
        return bool(self._token)

    def current(self) -> str:
        """Empty: none. The previous token while the file is not valid."""
        if self._file is not None:
            with self._lock:
                try:
                    if self._file.stat().st_mtime_ns != self._written:
                        self._read()
                except (OSError, NotFound, Unauthenticated, InvalidInput):
                    pass
        return self._token

    def _read(self) -> None:
        assert self._file is not None
        try:
            status = self._file.stat()
            text = self._file.read_bytes()[:_MAX_TOKEN_BYTES + 1]
        except OSError as error:
            raise NotFound(f"cannot read token file {self._file}: {error.strerror}",
                           advice="log in (`tissueform login`) or give another file") from error
        if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise Unauthenticated(f"token file {self._file} is readable by other users", advice="chmod 600 it")
        self._token = _checked(text.decode("ascii", "replace").strip(), f"token file {self._file}")
        self._written = status.st_mtime_ns


def _checked(token: str, what: str) -> str:
    if len(token) > _MAX_TOKEN_BYTES or _TOKEN.fullmatch(token) is None:
        raise InvalidInput(f"{what} does not hold a token: it is empty, too long or has other characters than tokens have",
                           advice="log in again (`tissueform login`)")
    return token


def is_local(address: str) -> bool:
    return address.startswith("unix:") or _LOOPBACK.fullmatch(address) is not None


def _bytes_of(path: Optional[PathLike]) -> Optional[bytes]:
    if path is None:
        return None
    try:
        return pathlib.Path(path).read_bytes()
    except OSError as error:
        raise NotFound(f"cannot read {os.fspath(path)}: {error.strerror}", advice="check the files of tls") from error


def _system_authorities() -> Optional[bytes]:
    """This machine's, which grpcio does not read: it has its own list. None: not found, then that list counts."""
    for path in (ssl.get_default_verify_paths().cafile, *_AUTHORITIES_OF_LINUX):
        if path is not None and os.path.isfile(path):
            return _bytes_of(path)
    return None


def _tls_credentials(files: Tls) -> Any:
    if (files.certificate is None) != (files.key is None):
        raise InvalidInput("a client certificate needs its key, and a key its certificate", advice="give both or none in Tls")
    authorities = _system_authorities() if files.ca is None else _bytes_of(files.ca)
    return grpc.ssl_channel_credentials(authorities, _bytes_of(files.key), _bytes_of(files.certificate))


def open_channel(address: str, token: Token, tls: Union[None, bool, Tls], insecure: bool) -> Any:
    """A grpc.Channel. A token goes to another machine only over TLS.

    Errors: InvalidInput (not HOST:PORT; no encryption where it is needed), NotFound (a file of TLS).
    """
    if re.fullmatch(r"unix:.+|[^/\s]+:\d{1,5}", address) is None:
        raise InvalidInput(f'"{address}" is not an address: give HOST:PORT or unix:/PATH', advice="for example localhost:50051")
    if tls:
        return grpc.secure_channel(address, _tls_credentials(tls if isinstance(tls, Tls) else Tls()), options=_OPTIONS)
    if not is_local(address) and token:
        raise InvalidInput(f"the token would go to {address} unencrypted", advice="give tls=True or tls=Tls(ca=...), or no token")
    if not is_local(address) and not insecure:
        raise InvalidInput(f"{address} is another machine",
                           advice="give tls=True or tls=Tls(ca=...), or insecure=True if its network is isolated")
    return grpc.insecure_channel(address, options=_OPTIONS)
