# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Checks the versions of grpcio and protobuf before the modules that need them are imported."""

from __future__ import annotations

import re
from typing import Tuple

MIN_GRPCIO = "1.49"
MIN_PROTOBUF = "3.20.2"
PIP_LINE = f"pip install --upgrade 'grpcio>={MIN_GRPCIO}' 'protobuf>={MIN_PROTOBUF}'"


def _numbers(version: str) -> Tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def check_version(package: str, found: str, needed: str) -> None:
    """Raises ImportError, with the line for pip, if `found` is older than `needed`."""
    if _numbers(found) < _numbers(needed):
        raise ImportError(f"tissueform needs {package} {needed} or newer, found {found}: {PIP_LINE}")


def check_libraries() -> None:
    """Raises ImportError, with the line for pip, if grpcio or protobuf is missing or too old."""
    try:
        import google.protobuf
        import grpc
    except ImportError as missing:
        raise ImportError(f"tissueform needs grpcio and protobuf ({missing}): {PIP_LINE}") from missing
    check_version("grpcio", grpc.__version__, MIN_GRPCIO)
    check_version("protobuf", google.protobuf.__version__, MIN_PROTOBUF)
