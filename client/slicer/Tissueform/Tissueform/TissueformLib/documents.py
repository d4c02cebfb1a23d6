# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The files that `tissueform plan build` reads: a recipe for a CT, or a list of surfaces (docs/bring-your-own.md)."""

from __future__ import annotations

import json
import pathlib
from typing import Any, Dict, List, Mapping, Optional, Sequence

import numpy.typing as npt
from tissueform import ras_to_lps

from .errors import SceneError
from .movements import OSTEOTOMIES, Bone, check_moves, planes_json, pose_json, pose_of

# Keys of a recipe that lists of surfaces have, too.
_OF_SURFACES = ("spacing_mm", "region_of_interest", "head_frame", "lips", "soft_tissue", "mesh", "contact_band_mm", "poisson_ratio", "model")


def read_settings(path: str) -> Dict[str, Any]:
    """The recipe that the user gives for all that the scene does not state; empty without a path."""
    if not path:
        return {}
    try:
        settings = json.loads(pathlib.Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SceneError(f"cannot read the settings {pathlib.Path(path).name}: {error}") from error
    if not isinstance(settings, dict) or settings.get("format") != "tissueform-recipe":
        raise SceneError(f"{pathlib.Path(path).name} is not a recipe: give a file as docs/recipe-format.md describes")
    return settings


def _segments(bones: Sequence[Bone]) -> List[Dict[str, Any]]:
    check_moves(bones)
    ordered = sorted(bones, key=lambda bone: list(OSTEOTOMIES).index(bone.name))
    return [{"name": bone.name, "osteotomy": OSTEOTOMIES[bone.name], "pose": pose_json(pose_of(bone))} for bone in ordered]


def _with_planes(segments: List[Dict[str, Any]], bones: Sequence[Bone], settings: Mapping[str, Any]) -> List[Dict[str, Any]]:
    """Cut planes are those of the scene, or else of the settings; poses are those of the scene."""
    planes = {segment.get("name"): segment["planes"] for segment in settings.get("segments", []) if "planes" in segment}
    planes.update({bone.name: planes_json(bone) for bone in bones if bone.cuts})
    return [{**segment, "planes": planes[segment["name"]]} if segment["name"] in planes else segment for segment in segments]


def _mouth(mouth_line: Optional[npt.NDArray[Any]]) -> Dict[str, Any]:
    """The key "lips", for a line from the right corner of the mouth to the left one in RAS, (#, 3); without one the key is left out."""
    if mouth_line is None:
        return {}
    if len(mouth_line) < 2:
        raise SceneError(f"the mouth line has {len(mouth_line)} points: place points from the right corner of the mouth to the left one")
    line = mouth_line if mouth_line[0][0] > mouth_line[-1][0] else mouth_line[::-1]  # +x is the patient's right in RAS
    return {"lips": {"part": True, "mouth_line_mm": [[round(float(number), 3) for number in point] for point in ras_to_lps(line)]}}


def recipe_of(bones: Sequence[Bone], *, names: Mapping[str, Sequence[str]], mouth_line: Optional[npt.NDArray[Any]] = None,
              settings: Optional[Mapping[str, Any]] = None) -> Dict[str, Any]:
    """The recipe of a scene. names: see structures.chosen_names. settings: see read_settings."""
    given = dict(settings or {})
    recipe: Dict[str, Any] = {**given, **_mouth(mouth_line), "format": "tissueform-recipe", "segments": _with_planes(_segments(bones), bones, given)}
    if names:
        recipe["labels"] = {**given.get("labels", {}), "names": {structure: list(of) for structure, of in names.items()}}
    recipe["version"] = max(int(given.get("version", 1)), 5 if "labels" in recipe else 4 if "lips" in recipe else 1)
    return recipe


def surfaces_of(bones: Sequence[Bone], files: Mapping[str, str], pieces: Mapping[str, str], *,
                mouth_line: Optional[npt.NDArray[Any]] = None, settings: Optional[Mapping[str, Any]] = None) -> Dict[str, Any]:
    """The list of surfaces of a scene without a CT. files: of "skin", "skull" and "lower_jaw", in LPS, which 3D Slicer writes. pieces:
    the file of each bone that is a model, by its name, or "lower_jaw" for the whole jaw: with one for every bone the models are the
    pieces that move; otherwise the plan cuts them. settings: see read_settings."""
    for needed in ("skin", "skull", "lower_jaw"):
        if needed not in files:
            raise SceneError(f"no model is chosen for the {needed.replace('_', ' ')}: without a CT skin, skull and lower jaw are needed")
    given = dict(settings or {})
    for key in given:
        if key not in (*_OF_SURFACES, "format", "version", "segments"):
            raise SceneError(f'the settings have "{key}", which needs a CT: leave it out')
    segments = _with_planes(_segments(bones), bones, given)
    if all(bone.name in pieces for bone in bones):
        segments = [{**segment, "surface": _surface(pieces[segment["name"]])} for segment in _segments(bones)]
    return {**{key: given[key] for key in _OF_SURFACES if key in given}, "format": "tissueform-surfaces", "version": 1, "units": "mm",
            "coordinate_system": "LPS", **{name: {"file": file} for name, file in files.items()}, **_mouth(mouth_line), "segments": segments}


def _surface(piece: str) -> Any:
    return piece if piece == "lower_jaw" else {"file": piece}
