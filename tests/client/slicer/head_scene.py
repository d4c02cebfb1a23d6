# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The bundled head (tests/data/ct/headsq) with labels that are made by rule, in RAS as 3D Slicer has it."""

import gzip
import os
import pathlib
import sys

import numpy as np

BIN = pathlib.Path(os.environ["TISSUEFORM_TEST_BIN"])
SOURCE = pathlib.Path(os.environ["TISSUEFORM_TEST_SOURCE"])
MODULE = SOURCE / "client/slicer/Tissueform/Tissueform"
sys.path.insert(0, str(MODULE))
# The axes of the file run to the right, back and down.
IJK_TO_RAS = np.diag([3.2, -3.2, -1.5, 1.0])
COARSE = {"format": "tissueform-recipe", "version": 1, "spacing_mm": 3, "mesh": {"edge_mm": 8, "fine_edge_mm": 6}}


def head_hu():
    """(64, 64, 93) int16."""
    raw = gzip.decompress((SOURCE / "tests/data/ct/headsq/headsq_quarter.raw.gz").read_bytes())
    return (np.frombuffer(raw, dtype="<i2").reshape(93, 64, 64).transpose(2, 1, 0) - 1024).astype(np.int16)


def grown(mask):
    """With the voxels that touch it by a face."""
    padded = np.pad(mask, 1)
    return (padded[1:-1, 1:-1, 1:-1] | padded[2:, 1:-1, 1:-1] | padded[:-2, 1:-1, 1:-1] | padded[1:-1, 2:, 1:-1] | padded[1:-1, :-2, 1:-1]
            | padded[1:-1, 1:-1, 2:] | padded[1:-1, 1:-1, :-2])


def component(mask, seed):
    part = np.zeros_like(mask)
    part[seed] = True
    while True:
        larger = grown(part) & mask
        if larger.sum() == part.sum():
            return part
        part = larger


def head_labels(hu):
    """1: mandible, 2: skull, 3: neck. Dense bone by connection and place; the rest of the bone by distance."""
    dense, bone = hu > 800, hu > 250
    front = np.argwhere(dense[:, :28])
    mandible = component(dense, tuple(front[np.argmax(front[:, 2])]))
    labels = np.where(dense, 2, 0)
    labels[:, 30:, 50:][dense[:, 30:, 50:]] = 3
    labels[mandible] = 1
    for _ in range(30):
        free = bone & (labels == 0)
        for label in (1, 2, 3):
            labels[free & grown(labels == label) & (labels == 0)] = label
    return labels.astype(np.uint8)
