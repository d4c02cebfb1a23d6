# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Calls of a server: headers, deadlines, and attempts at the servers of a cluster (docs/scaling.md), as the C++ client makes them."""

from __future__ import annotations

import collections
import random
import re
import secrets
import threading
import time
from typing import Any, Callable, Iterator, List, Optional, Tuple, TypeVar

import grpc

from ._channel import Token
from .errors import NotFound, ServerError, ServerUnavailable, TissueformError, error_of_call

_SESSION_HEADER, _NODE_HEADER = "x-tissueform-session", "x-tissueform-node"
_SESSION_NAME = re.compile(r"sessions/([A-Za-z0-9-]{16,64})")
_NODE_NAME = re.compile(r"[A-Za-z0-9_.:-]{1,255}")
_MAX_ROUTES = 10_000
_MAX_HOPS = 4
FAILOVER_SECONDS = 30.0

Metadata = List[Tuple[str, str]]
Result = TypeVar("Result")


def new_id() -> str:
    """128 random bits, for request ids: a call that is repeated with one is done once."""
    return secrets.token_hex(16)


class Backoff:
    """Waits that grow, each by chance up to a fifth longer or shorter."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._seconds = 0.05

    def after(self, error: Optional[TissueformError]) -> float:
        """Seconds. While a session moves to another server, at most 0.4: a hand waits for it."""
        longest = 0.4 if error is not None and error.reason == "SESSION_MOVED" else 2.0
        seconds = min(self._seconds, longest)
        self._seconds = min(self._seconds * 1.6, 2.0)
        return seconds * random.uniform(0.8, 1.2)


def node_in(error: TissueformError) -> str:
    """The server of the cluster that the error names; empty: none."""
    node = error.metadata.get("node", "") if error.reason in ("SESSION_MOVED", "MEMORY_BUDGET_FULL") else ""
    return node if _NODE_NAME.fullmatch(node) else ""


def _is_lost(error: TissueformError) -> bool:
    return isinstance(error, (ServerUnavailable, ServerError)) and error.reason != "NOT_IMPLEMENTED"


def _nothing_was_done(error: TissueformError) -> bool:
    return error.reason in ("SESSION_MOVED", "WRONG_NODE", "SERVER_DRAINING")


class _Routes:
    """Which server of a cluster answered last for a session. Thread-safe."""

    def __init__(self) -> None:
        self.in_cluster = False
        self._lock = threading.Lock()
        self._nodes: "collections.OrderedDict[str, str]" = collections.OrderedDict()

    def node_of(self, session: str) -> str:
        with self._lock:
            return self._nodes.get(session, "")

    def remember(self, session: str, node: str) -> None:
        if _NODE_NAME.fullmatch(node) is None:
            return
        self.in_cluster = True
        if not session:
            return
        with self._lock:
            self._nodes[session] = node
            self._nodes.move_to_end(session)
            if len(self._nodes) > _MAX_ROUTES:
                self._nodes.popitem(last=False)

    def forget(self, session: str) -> None:
        with self._lock:
            self._nodes.pop(session, None)

    def learn_from(self, error: TissueformError, session: str) -> None:
        self.in_cluster = self.in_cluster or error.reason in ("SESSION_MOVED", "WRONG_NODE")
        node = node_in(error)
        if node:
            self.remember(session, node)
        elif _is_lost(error):
            self.forget(session)


class Attempts:
    """The attempts of one call, until it succeeds or another one would not do better. One thread."""

    def __init__(self, caller: "Caller", session: str, repeat_if_lost: bool, patience: float) -> None:
        self._caller = caller
        self._session = session
        self._repeat_if_lost = repeat_if_lost
        self._patience = patience
        self._backoff = Backoff()
        self._hops = 0
        self._tried_at_once = False
        self._node = ""
        self._give_up: Optional[float] = None

    def metadata(self) -> Metadata:
        """Of the next attempt."""
        return self._caller.metadata(self._session, "" if self._session else self._node)

    def after(self, error: TissueformError) -> Optional[float]:
        """Seconds to wait before the next attempt; None: it is over."""
        routes = self._caller.routes
        routes.learn_from(error, self._session)
        self._node = node_in(error)
        if self._node and self._hops < _MAX_HOPS:
            self._hops += 1
            return 0.0
        if not routes.in_cluster or not (_nothing_was_done(error) or (self._repeat_if_lost and _is_lost(error))):
            return None
        if error.reason == "SESSION_MOVED" and self._patience > 0 and not self._tried_at_once:
            self._tried_at_once = True
            return 0.0
        now = time.monotonic()
        self._give_up = self._give_up or now + self._patience
        wait = self._backoff.after(error)
        return wait if now + wait <= self._give_up else None


class Caller:
    """A channel with everything that each call needs. Thread-safe."""

    def __init__(self, channel: Any, token: Token, call_timeout: float) -> None:
        self.channel = channel
        self.token = token
        self.call_timeout = call_timeout
        self.routes = _Routes()

    def stub(self, service: Any) -> Any:
        """Of a generated class such as MeshServiceStub, which has no types."""
        return service(self.channel)

    def metadata(self, session: str, node: str = "") -> Metadata:
        """Headers of a call that concerns `session` ("sessions/{id}"; empty: none)."""
        metadata: Metadata = []
        token = self.token.current()
        if token:
            metadata.append(("authorization", f"Bearer {token}"))
        named = _SESSION_NAME.fullmatch(session)
        if named:
            metadata.append((_SESSION_HEADER, named[1]))
        node = node or self.routes.node_of(session)
        if node:
            metadata.append((_NODE_HEADER, node))
        return metadata

    def remember_node(self, session: str, initial_metadata: Any) -> None:
        self.routes.remember(session, dict(initial_metadata or ()).get(_NODE_HEADER, ""))

    def run(self, attempt: Callable[[Metadata], Tuple[Result, Any]], session: str = "", *, repeat_if_lost: bool = True,
            patience: float = FAILOVER_SECONDS) -> Result:
        """`attempt` makes the call with these headers and returns its result and its initial metadata. Raises TissueformError."""
        attempts = Attempts(self, session, repeat_if_lost, patience)
        while True:
            try:
                result, initial_metadata = attempt(attempts.metadata())
                self.remember_node(session, initial_metadata)
                return result
            except grpc.RpcError as raised:
                error = error_of_call(raised)
            wait = attempts.after(error)
            if wait is None:
                raise error
            time.sleep(wait)

    def unary(self, method: Any, request: Any, session: str = "", *, repeat_if_lost: bool = True) -> Any:
        """The response of a unary call."""
        def attempt(metadata: Metadata) -> Tuple[Any, Any]:
            response, call = method.with_call(request, timeout=self.call_timeout, metadata=metadata)
            return response, call.initial_metadata()
        return self.run(attempt, session, repeat_if_lost=repeat_if_lost)

    def stream(self, method: Any, request: Any, take: Callable[[Iterator[Any]], Result], session: str = "", *,
               repeat_if_lost: bool = True) -> Result:
        """What `take` makes of the responses of a call; the call is canceled if `take` raises or does not read to the end."""
        def attempt(metadata: Metadata) -> Tuple[Result, Any]:
            call = method(request, timeout=self.call_timeout, metadata=metadata)
            try:
                return take(call), call.initial_metadata()
            finally:
                call.cancel()
        return self.run(attempt, session, repeat_if_lost=repeat_if_lost)

    def delete(self, method: Any, request: Any, session: str = "") -> None:
        """NOT_FOUND after a lost attempt means that it was deleted."""
        lost = False

        def attempt(metadata: Metadata) -> Tuple[None, Any]:
            nonlocal lost
            try:
                _, call = method.with_call(request, timeout=self.call_timeout, metadata=metadata)
                return None, call.initial_metadata()
            except grpc.RpcError as raised:
                if lost and isinstance(error_of_call(raised), NotFound):
                    return None, ()
                lost = True
                raise
        self.run(attempt, session)
        self.routes.forget(session)

    def pages(self, method: Any, request: Any, field: str) -> Iterator[Any]:
        """All entries of a list, page after page. `request` is changed."""
        while True:
            page = self.unary(method, request)
            yield from getattr(page, field)
            if not page.next_page_token:
                return
            request.page_token = page.next_page_token
