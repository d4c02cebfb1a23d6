# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A mesh for examples and tests."""

from __future__ import annotations

import itertools
from typing import Tuple

import numpy as np
import numpy.typing as npt


def sample_bar(cells: Tuple[int, int, int] = (3, 3, 8), spacing_mm: float = 5.0) -> Tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Points (#V, 3) in mm and tets (#T, 4) of a bar along z from the origin. cells: along x, y, z; each is cut into six tets (Kuhn)."""
    shape = np.array(cells) + 1
    points = spacing_mm * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    corners = np.array(list(itertools.product(*map(range, cells)))) @ strides
    tets = []
    for order in itertools.permutations(range(3)):
        path = np.cumsum([0, *strides[list(order)]])
        if np.linalg.det(np.eye(3)[list(order)]) < 0:
            path[[2, 3]] = path[[3, 2]]
        tets.append(corners[:, None] + path)
    return points, np.concatenate(tets)
