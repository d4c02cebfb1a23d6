# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A server of one's own on this machine, for notebooks and scripts."""

from __future__ import annotations

import collections
import os
import pathlib
import select
import subprocess
import threading
import time
from typing import Any, Deque, Mapping, Optional, Sequence

from ._channel import PathLike
from ._programs import find_program
from .client import Client, connect
from .errors import NotFound, ServerUnavailable

_GRACE_MS = 30_000
_KEPT_LINES = 50


def _find_guard(server: pathlib.Path) -> pathlib.Path:
    for guard in (server.parent / "tissueform-guard", server.parent.parent / "libexec/tissueform/tissueform-guard"):
        if os.access(guard, os.X_OK):
            return guard
    raise NotFound(f"there is no tissueform-guard next to {server} or in libexec/tissueform", advice="install the whole package tissueform-server")


class LocalServer:
    """Made by local. address: "127.0.0.1:PORT". Ends with its `with` block or close, and with this process for any reason."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self._process = process
        self._log: Deque[str] = collections.deque(maxlen=_KEPT_LINES)
        self._reader = threading.Thread(target=self._read_log, name="tissueform-server-log", daemon=True)
        self._reader.start()
        self.address = ""

    def __repr__(self) -> str:
        return f"LocalServer({self.address!r})"

    def __enter__(self) -> "LocalServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def log(self) -> Sequence[str]:
        """The last lines of the server's log."""
        return list(self._log)

    def connect(self, **options: Any) -> Client:
        """See tissueform.connect, whose options it takes."""
        return connect(self.address, **options)

    def close(self) -> None:
        """Ends the server; waits until it has ended."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._process.wait()
        self._reader.join()
        if self._process.stderr is not None:
            self._process.stderr.close()

    def _read_log(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self._log.append(line.decode("utf-8", "replace").rstrip())

    def _wait_until_listening(self, timeout: float) -> None:
        assert self._process.stdout is not None
        give_up, text = time.monotonic() + timeout, b""
        while b"\n" not in text:
            left = give_up - time.monotonic()
            if left <= 0 or not select.select([self._process.stdout], [], [], left)[0]:
                raise ServerUnavailable(f"tissueform-server was not ready in {timeout:g} s", advice="give timeout more seconds")
            data = os.read(self._process.stdout.fileno(), 256)
            if not data:
                self._reader.join(timeout=1)
                last = self._log[-1] if self._log else "it wrote no message"
                raise ServerUnavailable(f"tissueform-server ended before it was ready: {last}", advice="correct its options")
            text += data
        self.address = text.decode().splitlines()[0].replace("listening on ", "")


def local(program: Optional[PathLike] = None, *, options: Sequence[str] = (), timeout: float = 30.0,
          environment: Optional[Mapping[str, str]] = None) -> LocalServer:
    """Starts a tissueform-server of this machine as a child, on a free port of loopback, which stores nothing on the disk.

    program: path of tissueform-server (default: the environment's TISSUEFORM_SERVER_PROGRAM, or the one in PATH). options: more options of
    the command line, for example ["--memory-budget-mib", "4096"]. timeout: seconds until it must be ready. environment:
    variables of the server (default: those of this process). Linux only.

    Errors: NotFound (no such program), ServerUnavailable (it did not start; the message has its last line).
    """
    binary = find_program("tissueform-server", program)
    command = [str(_find_guard(binary)), str(_GRACE_MS), "0", "0", "0", str(binary), "--host", "127.0.0.1", "--port", "0", "--in-memory", *options]
    # The guard ends the server when this pipe closes, so also when this process is killed.
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
                               env=environment)
    server = LocalServer(process)
    try:
        server._wait_until_listening(timeout)
    except BaseException:
        server.close()
        raise
    return server
