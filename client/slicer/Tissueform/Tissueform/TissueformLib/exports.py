# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Files for other programs."""

from __future__ import annotations

import csv
import json
import pathlib
from typing import Dict, Mapping, Sequence

import numpy as np
import numpy.typing as npt
from tissueform import Pose

from .errors import SceneError
from .face import MAPS, FaceLandmark
from .movements import pose_json


def write_plan(plan_file: pathlib.Path, poses: Mapping[str, Pose]) -> pathlib.Path:
    """Writes a copy of the plan with these poses next to it, for `tissueform deform`; a mesh is found in its plan's folder only.
    Returns its path."""
    plan = json.loads(plan_file.read_text(encoding="utf-8"))
    for handle in plan["handles"]:
        if handle["name"] in poses:
            handle["pose"] = pose_json(poses[handle["name"]])
    return _write(plan_file.with_name("plan_moved.json"), json.dumps(plan, indent=2) + "\n")


def write_landmarks(file: pathlib.Path, landmarks: Sequence[FaceLandmark], maps: Dict[str, npt.NDArray[np.float32]]) -> pathlib.Path:
    """Writes a table of the landmarks on the face and their movements in mm. Returns its path."""
    lines = [["landmark", *MAPS], *([mark.label, *(f"{maps[name][mark.vertex]:.3f}" for name in MAPS)] for mark in landmarks if mark.is_on_face)]
    try:
        with open(file, "w", newline="", encoding="utf-8") as table:
            csv.writer(table).writerows(lines)
    except OSError as error:
        raise SceneError(f"cannot write {file.name}: {error.strerror}") from error
    return file


def _write(file: pathlib.Path, text: str) -> pathlib.Path:
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise SceneError(f"cannot write {file.name}: {error.strerror}") from error
    return file
