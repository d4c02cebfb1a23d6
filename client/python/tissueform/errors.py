# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Errors: each has a reason for programs, a message for people, and what to do."""

from __future__ import annotations

from typing import Any, Dict, Mapping, Optional, Type

import grpc

from ._error_details import ErrorDetails, details_of

# What to do, by the reasons of docs/service-api.md.
ADVICE: Mapping[str, str] = {
    "MESH_NOT_FOUND": "upload the mesh",
    "SESSION_NOT_FOUND": "create the session again",
    "SESSION_ID_TAKEN": "choose another session_id, or delete that session",
    "REQUEST_ID_REUSED": "choose a new request_id",
    "SESSION_BEING_DELETED": "try again in a moment",
    "TOO_MANY_SESSIONS": "delete a session, or try later",
    "TOO_MANY_STREAMS": "close a drag, or try later",
    "TOO_MANY_WATCHES": "close a watch, or try later",
    "WATCH_NOT_FOUND": "begin another watch",
    "MEMORY_BUDGET_FULL": "delete sessions or meshes, or try later",
    "MESH_TOO_LARGE": "use a smaller mesh, or a server with higher limits",
    "SERVER_DRAINING": "use another server, or try again in a minute",
    "MESH_DAMAGED_ON_ITS_WAY": "upload the mesh again",
    "CHUNK_OUT_OF_PLACE": "upload the mesh again",
    "UPLOAD_SILENT": "upload the mesh again",
    "NO_CONFIGURATION_IN_TIME": "open the drag again",
    "POSE_SEQUENCE_NOT_RISING": "open the drag again",
    "NO_PREPARED_ANSWERS": "leave prepared out, or choose another model",
    "NOT_POSITIVE_DEFINITE": "check the mesh and its stiffness",
    "STALE_ETAG": "get the session again, then change it",
    "SESSION_UPDATED": "get the session again and open a new drag",
    "MESH_IN_USE": "delete its sessions first",
    "EXPORT_NOT_FOUND": "request the export again",
    "TOO_MANY_EXPORTS": "wait for the bridge, or withdraw some exports",
    "SESSION_MOVED": "try again in a moment",
    "WRONG_NODE": "try again in a moment",
    "PREDICTION_NOT_FOUND": "store the prediction again",
    "NOT_COMPARABLE": "compare predictions of one mesh",
    "UPLOAD_NOT_FOUND": "upload the mesh again",
    "UPLOAD_UNDER_WAY": "try again in a moment",
    "DISK_FULL": "try later, or ask the server's operator",
    "CASE_NOT_FOUND": "upload the case again",
    "TOO_MANY_CASES": "delete some cases",
    "AUDIT_NOT_WRITTEN": "try later, or ask the server's operator",
    "CASE_DAMAGED_ON_ITS_WAY": "upload the case again",
    "QUOTA_EXCEEDED": "wait, or delete what you no longer need",
    "INVALID_REQUEST": "correct what the message names",
    "NOT_FOUND": "check the name",
    "ALREADY_EXISTS": "choose another name",
    "LIMIT_EXCEEDED": "stay below the limit that the message names",
    "STATE_NOT_FIT": "check the state that the message names",
    "CHANGED_MEANWHILE": "try again",
    "DATA_DAMAGED": "ask the server's operator",
    "UNAVAILABLE": "try again later",
    "CANCELLED": "start again if this was not on purpose",
    "DEADLINE_PASSED": "give call_timeout more seconds, or try later",
    "PERMISSION_DENIED": "ask the owner, or the server's operator, for this right",
    "UNAUTHENTICATED": "log in again (`tissueform login`) and connect with the new token",
    "NOT_IMPLEMENTED": "update the server, or use the package of its version",
    "INTERNAL_ERROR": "report this defect to the server's operator",
}
WHERE_IS_IT = "check the address and whether the server runs: `python3 -m tissueform doctor HOST:PORT`"


class TissueformError(Exception):
    """Base of all errors of this package.

    Attributes: `reason` (a stable name such as "SESSION_NOT_FOUND"), `message` (what happened, one line), `advice` (what to do),
    `metadata` (facts for programs, such as {"limit": "64"}).
    """

    default_reason = "INTERNAL_ERROR"

    def __init__(self, message: str, *, reason: str = "", advice: str = "", metadata: Optional[Mapping[str, str]] = None) -> None:
        super().__init__(message)
        self.message = message
        self.reason = reason or self.default_reason
        self.advice = advice or ADVICE.get(self.reason) or ADVICE[self.default_reason]
        self.metadata: Dict[str, str] = dict(metadata or {})

    def __str__(self) -> str:
        return f"{self.message} ({self.reason}); {self.advice}"


class InvalidInput(TissueformError, ValueError):
    """An argument is wrong; found here or by the server."""

    default_reason = "INVALID_REQUEST"


class NotFound(TissueformError, LookupError):
    """The server does not have the resource, or the caller may not read it."""

    default_reason = "NOT_FOUND"


class Conflict(TissueformError):
    """The resource exists already, has changed, or is not in the necessary state."""

    default_reason = "STATE_NOT_FIT"


class LimitExceeded(TissueformError):
    """A limit of the server or a quota of the caller."""

    default_reason = "LIMIT_EXCEEDED"


class ServerUnavailable(TissueformError, ConnectionError):
    """The server cannot be reached, or is shutting down."""

    default_reason = "UNAVAILABLE"


class DeadlineExceeded(TissueformError, TimeoutError):
    """The call took longer than its timeout."""

    default_reason = "DEADLINE_PASSED"


class Unauthenticated(TissueformError):
    """There is no token, or it has expired or is not valid at this server."""

    default_reason = "UNAUTHENTICATED"


class AccessDenied(TissueformError, PermissionError):
    """The caller may not do this."""

    default_reason = "PERMISSION_DENIED"


class DataDamaged(TissueformError):
    """Bytes were damaged in transit or in the server's store."""

    default_reason = "DATA_DAMAGED"


class Cancelled(TissueformError):
    """The caller canceled the call."""

    default_reason = "CANCELLED"


class ServerError(TissueformError):
    """A defect of the server, or a method that it does not have."""


_CLASSES: Mapping[int, Type[TissueformError]] = {
    1: Cancelled, 3: InvalidInput, 4: DeadlineExceeded, 5: NotFound, 6: Conflict, 7: AccessDenied, 8: LimitExceeded, 9: Conflict,
    10: Conflict, 11: InvalidInput, 14: ServerUnavailable, 15: DataDamaged, 16: Unauthenticated,
}
_REASON_OF_CODE: Mapping[int, str] = {6: "ALREADY_EXISTS", 10: "CHANGED_MEANWHILE", 12: "NOT_IMPLEMENTED"}


def error_of_call(error: grpc.RpcError, *, was_cancelled: bool = False) -> TissueformError:
    """The error of a gRPC call. CANCELLED without `was_cancelled` means that the connection is lost: ServerUnavailable."""
    call: Any = error  # each RpcError of a call is a grpc.Call, too
    code, message = call.code().value[0], call.details() or "the call failed"
    details = ErrorDetails()
    for key, value in call.trailing_metadata() or ():
        if key == "grpc-status-details-bin":
            details = details_of(value)
    if details.code and details.code != code:  # a proxy has ended the call; the server's own status counts
        code, message = details.code, details.message
    if code == 1 and not was_cancelled:
        code = 14
        details.reason = "" if details.reason == "CANCELLED" else details.reason
    if code == 12 and not details.reason:
        message = "this server is older than this package and does not have this call"
    reason = details.reason or _REASON_OF_CODE.get(code, "")
    advice = WHERE_IS_IT if code == 14 and not details.reason else ""
    return _CLASSES.get(code, ServerError)(message.replace("\n", " "), reason=reason, advice=advice, metadata=details.metadata)


def is_transient(error: TissueformError) -> bool:
    """Whether another attempt may succeed although nothing changes."""
    lost = isinstance(error, ServerError) and error.reason != "NOT_IMPLEMENTED"
    return lost or isinstance(error, (ServerUnavailable, LimitExceeded))
