# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Which structure of a head a segment is, by its name: the rules of core/imaging/labels/structures.cc, which a test compares."""

from __future__ import annotations

import re
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

from .errors import SceneError

# The keys of "labels/names" in a recipe, and the names that `tissueform plan build` knows itself.
NAMES: Mapping[str, Tuple[str, ...]] = {
    "mandible": ("mandible", "lower jaw", "lower jawbone", "mandible bone", "mandibular bone"),
    "skull": ("maxilla and upper skull", "maxilla upper skull", "skull", "upper skull", "cranium", "maxilla", "upper jaw", "upper jawbone",
              "maxillary bone"),
    "upper_teeth": ("upper teeth", "teeth upper", "maxillary teeth"),
    "lower_teeth": ("lower teeth", "teeth lower", "mandibular teeth"),
    "canal": ("mandibular canal", "inferior alveolar canal", "mandible canal", "inferior alveolar nerve", "canal"),
    "sinus": ("sinus maxillary", "sinus frontal", "maxillary sinus", "frontal sinus", "sphenoid sinus", "ethmoid sinus", "sinus", "sinuses"),
    "head": ("head", "skin"),
    "airway": ("airway", "upper airway", "pharynx", "nasal cavity", "trachea"),
    "tube": ("tube", "endotracheal tube", "breathing tube"),
    "spine": ("spine", "cervical spine", "vertebrae", "hyoid", "hyoid bone", *(f"vertebrae c{number}" for number in range(1, 8))),
    "muscle": ("muscle", "muscles", "skeletal muscle", "masseter"),
    "fat": ("fat", "subcutaneous fat", "torso fat", "adipose tissue"),
}
_STRUCTURES = {name: structure for structure, names in NAMES.items() for name in names}
_SIDES = ("left", "l", "right", "r")


def structure_of(name: str) -> Optional[str]:
    """Case, separators and words for a side do not matter. None: not known."""
    words = re.sub(r"[^a-z0-9]", " ", name[:200].lower()).split()
    return _STRUCTURES.get(" ".join(word for word in words if word not in _SIDES))


def chosen_names(chosen: Sequence[Tuple[str, str]]) -> Dict[str, List[str]]:
    """What a recipe must state under "labels/names". chosen: each segment's name and its structure, "" for one that is not used.
    Segments that the program recognizes by itself are left out, so that it also checks their sides.

    Raises SceneError: no bone, a segment without a name, one that the program would use although it is not chosen, two meanings of a name.
    """
    by_name: Dict[str, str] = {}
    for name, structure in chosen:
        if not name.strip():
            raise SceneError("a segment has no name: name it in the module Segment Editor")
        if by_name.setdefault(name, structure) != structure:
            raise SceneError(f'two segments have the name "{name}" and different structures: rename one')
        if not structure and structure_of(name):
            raise SceneError(f'segment "{name}" has the name of a structure but is not used: rename it, or choose "{structure_of(name)}"')
    if not {"mandible", "skull"} & set(by_name.values()):
        raise SceneError('no segment is the mandible or the skull: choose "mandible" or "skull" for a segment')
    names: Dict[str, List[str]] = {}
    for name, structure in by_name.items():
        if structure and structure_of(name) != structure:
            names.setdefault(structure, []).append(name)
    return names


def notes_on(chosen: Sequence[Tuple[str, str]]) -> List[str]:
    """A line for each segment that is not used."""
    return [f'segment "{name}" is not used: its name is not known; choose a structure' for name, structure in chosen if not structure]
