# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Checks the versions of grpcio and protobuf before the modules that need them are imported."""

from __future__ import annotations

import re
import sys
from typing import Dict, Tuple

MIN_GRPCIO = "1.49"
MIN_PROTOBUF = "3.20.2"
PIP_LINE = f"pip install --upgrade 'grpcio>={MIN_GRPCIO}' 'protobuf>={MIN_PROTOBUF}' numpy"


def _numbers(version: str) -> Tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def check_version(package: str, found: str, needed: str) -> None:
    """Raises ImportError, with the line for pip, if `found` is older than `needed`."""
    if _numbers(found) < _numbers(needed):
        raise ImportError(f"tissueform needs {package} {needed} or newer, found {found}: {PIP_LINE}")


def library_versions() -> Dict[str, str]:
    """Raises ImportError, with the line for pip, if a library is missing."""
    try:
        import google.protobuf
        import grpc
        import numpy
    except ImportError as missing:
        raise ImportError(f"tissueform needs grpcio, protobuf and numpy ({missing}): {PIP_LINE}") from missing
    return {"grpcio": grpc.__version__, "protobuf": google.protobuf.__version__, "numpy": numpy.__version__}


def check_libraries() -> None:
    """Raises ImportError, with the line for pip, if a library is missing or too old; `python3 -m tissueform` ends with that line."""
    try:
        found = library_versions()
        check_version("grpcio", found["grpcio"], MIN_GRPCIO)
        check_version("protobuf", found["protobuf"], MIN_PROTOBUF)
    except ImportError as error:
        if "-m tissueform" in " ".join(getattr(sys, "orig_argv", ())):
            sys.exit(str(error))
        raise
