# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Reads google.rpc.Status with its ErrorInfo. The generated modules of googleapis-common-protos would conflict with other packages."""

from __future__ import annotations

import dataclasses
from typing import Dict, Iterator, Tuple, Union


@dataclasses.dataclass
class ErrorDetails:
    """What a server says of an error; empty where it says nothing."""

    code: int = 0
    message: str = ""
    reason: str = ""
    metadata: Dict[str, str] = dataclasses.field(default_factory=dict)


def _varint(data: bytes, at: int) -> Tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7


def _fields(data: bytes) -> Iterator[Tuple[int, Union[int, bytes]]]:
    """Number and value of each field. Only the two encodings that these messages have: varint and length-delimited."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        value, at = _varint(data, at)
        if key & 7 == 0:
            yield key >> 3, value
        elif key & 7 == 2 and at + value <= len(data):
            yield key >> 3, data[at:at + value]
            at += value
        else:
            raise ValueError("not a google.rpc.Status")


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else ""


def _take_error_info(data: bytes, details: ErrorDetails) -> None:
    for number, value in _fields(data):
        if number == 1:
            details.reason = _text(value)
        elif number == 3 and isinstance(value, bytes):
            entry = dict(_fields(value))
            details.metadata[_text(entry.get(1))] = _text(entry.get(2))


def details_of(status: bytes) -> ErrorDetails:
    """Of the bytes of a google.rpc.Status; empty if they are not one."""
    details = ErrorDetails()
    try:
        for number, value in _fields(status):
            if number == 1 and isinstance(value, int):
                details.code = value
            elif number == 2:
                details.message = _text(value)
            elif number == 3 and isinstance(value, bytes):
                detail = dict(_fields(value))
                content = detail.get(2, b"")
                if _text(detail.get(1)).endswith("/google.rpc.ErrorInfo") and isinstance(content, bytes):
                    _take_error_info(content, details)
    except (ValueError, IndexError):
        return ErrorDetails()
    return details
