# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Finds, in a scene that `tissueform plan export --slicer` has written, what the module needs, by the names of its nodes."""

from __future__ import annotations

import collections
import dataclasses
from typing import Dict, List, Mapping, Sequence, Tuple

from .errors import SceneError
from .movements import OSTEOTOMIES

MODEL, TRANSFORM, MARKUPS = "vtkMRMLModelNode", "vtkMRMLLinearTransformNode", "vtkMRMLMarkupsFiducialNode"
# As client/cli/predict/slicer_scene.cc names nodes.
_PLANNED, _MOVEMENT = " (planned)", " movement"
_LANDMARKS = "Landmarks (pre-op)"


@dataclasses.dataclass(frozen=True)
class ExportedScene:
    """bones: class and name of the node of each bone that moves, by its name in OSTEOTOMIES. landmarks: the name of their node; empty: none.
    unknown: bones that the module does not move."""

    bones: Mapping[str, Tuple[str, str]]
    landmarks: str
    unknown: Sequence[str]

    def notes(self) -> List[str]:
        """A line for each bone that the module does not move."""
        return [f'"{name}" moves in the scene but is not one of {", ".join(OSTEOTOMIES)}: it stays in the plan\'s place' for name in self.unknown]


def find_exported(names: Mapping[str, Sequence[str]]) -> ExportedScene:
    """names: of the nodes of the scene, by MODEL, TRANSFORM and MARKUPS.

    Raises SceneError: not such a scene; a name that several nodes have, as where the scene was opened twice.
    """
    moving = [name[:-len(_MOVEMENT)] for name in names[TRANSFORM] if name.endswith(_MOVEMENT)]
    if not moving:
        raise SceneError("the scene has no transform named like \"mandible movement\": open the scene.mrml that "
                         "`tissueform plan export --slicer` has written")
    _check_once([f"{name}{_MOVEMENT}" for name in moving])
    bones: Dict[str, Tuple[str, str]] = {}
    for name in (bone for bone in moving if bone in OSTEOTOMIES):
        models = [model for model in names[MODEL] if model == name + _PLANNED]
        _check_once(models)
        # A plan without viewer.glb has no model of that name: the transform serves.
        bones[name] = (MODEL, models[0]) if models else (TRANSFORM, name + _MOVEMENT)
    if not bones:
        raise SceneError(f"no bone of the scene is named {', '.join(OSTEOTOMIES)}: choose the bones yourself")
    landmarks = [name for name in names[MARKUPS] if name == _LANDMARKS]
    _check_once(landmarks)
    return ExportedScene(bones, landmarks[0] if landmarks else "", [name for name in moving if name not in OSTEOTOMIES])


def _check_once(names: Sequence[str]) -> None:
    for name, count in collections.Counter(names).items():
        if count > 1:
            raise SceneError(f'the scene has {count} nodes named "{name}": close the scene and open the exported one once')
