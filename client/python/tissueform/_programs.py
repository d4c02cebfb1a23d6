# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Programs of this machine."""

from __future__ import annotations

import os
import pathlib
import shutil
from typing import Optional

from ._channel import PathLike
from .errors import NotFound


def find_program(name: str, program: Optional[PathLike]) -> pathlib.Path:
    """`program`, or what the environment names (TISSUEFORM_SERVER_PROGRAM for tissueform-server), or `name` in PATH."""
    variable = f"{name.upper().replace('-', '_')}_PROGRAM"
    wanted = os.fspath(program) if program is not None else os.environ.get(variable, name)
    found = shutil.which(wanted)
    if found is None:
        raise NotFound(f"there is no program {wanted}", advice=f"install the package {name}, set {variable}, or give program=PATH")
    return pathlib.Path(found).resolve()
