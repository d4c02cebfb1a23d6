# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Uploads that continue where an earlier attempt broke off."""

from __future__ import annotations

import time
from typing import Any, Callable, Iterator, Optional, Protocol

import grpc

from ._calls import Backoff
from .errors import DataDamaged, DeadlineExceeded, LimitExceeded, TissueformError, error_of_call, is_transient

Progress = Callable[[int, int], None]

CHUNK_BYTES = 512 << 10
_GIVE_UP_SECONDS = 60.0


class Payload(Protocol):
    """What is sent. failure: of the caller's on_progress, which gRPC calls on a thread of its own."""

    total_bytes: int
    failure: Optional[BaseException]

    def requests(self, begin: int, on_progress: Optional[Progress]) -> Iterator[Any]:
        """The header and the chunks from byte `begin` on."""
        ...


def report(payload: Payload, on_progress: Optional[Progress], sent_bytes: int) -> None:
    """Calls on_progress; its exception is raised again by send_resumable."""
    if on_progress is None:
        return
    try:
        on_progress(sent_bytes, payload.total_bytes)
    except BaseException as failure:
        payload.failure = failure
        raise RuntimeError("on_progress has failed") from failure  # gRPC ends a call only after an Exception


def _may_repeat(error: TissueformError, damaged_before: bool) -> bool:
    if isinstance(error, DataDamaged):
        return not damaged_before
    if error.reason in ("UPLOAD_NOT_FOUND", "CHUNK_OUT_OF_PLACE", "CHANGED_MEANWHILE", "UPLOAD_UNDER_WAY"):
        return True
    return isinstance(error, DeadlineExceeded) or (is_transient(error) and not isinstance(error, LimitExceeded))


def send_resumable(payload: Payload, committed_bytes: Callable[[], int], call: Callable[[Iterator[Any]], Any],
                   on_progress: Optional[Progress]) -> Any:
    """The response of `call`, which sends the requests that it is given from committed_bytes() on. Tries again until no attempt has come
    farther for a minute. Raises TissueformError, or what on_progress has raised."""
    backoff, damaged_before, farthest = Backoff(), False, 0
    give_up = time.monotonic() + _GIVE_UP_SECONDS
    while True:
        try:
            begin = committed_bytes()
            if begin > farthest:  # the last attempt was of use
                farthest, give_up = begin, time.monotonic() + _GIVE_UP_SECONDS
            return call(payload.requests(begin, on_progress))
        except grpc.RpcError as raised:
            error = error_of_call(raised)
        if payload.failure is not None:
            raise payload.failure
        wait = backoff.after(error)
        if not _may_repeat(error, damaged_before) or time.monotonic() + wait > give_up:
            raise error
        damaged_before = damaged_before or isinstance(error, DataDamaged)
        time.sleep(wait)
