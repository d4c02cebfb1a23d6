# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Meshes of meshio and PyVista and images of nibabel, which are optional: pip install 'tissueform[meshio,pyvista,nibabel]'."""

from __future__ import annotations

from typing import Any, Optional, Tuple

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .meshes import STIFFNESS_ARRAY
from .volumes import Volume


def from_meshio(mesh: Any) -> Tuple[npt.NDArray[np.float64], npt.NDArray[np.int64], Optional[npt.NDArray[np.float64]]]:
    """Points (#V, 3), tets (#T, 4) and stiffness in Pa (#T,) of a meshio.Mesh, for upload_mesh. stiffness is the cell array
    "youngs_modulus_pa", or None. Errors: InvalidInput (no linear tets)."""
    blocks = [index for index, cells in enumerate(mesh.cells) if cells.type == "tetra"]
    if not blocks:
        raise InvalidInput("the mesh has no linear tets", advice="give a mesh with cells of the type tetra")
    tets = np.concatenate([mesh.cells[index].data for index in blocks]).astype(np.int64)
    arrays = mesh.cell_data.get(STIFFNESS_ARRAY)
    stiffness = None if arrays is None else np.concatenate([np.asarray(arrays[index]).ravel() for index in blocks]).astype(np.float64)
    return np.asarray(mesh.points, dtype=np.float64), tets, stiffness


def to_meshio(points: npt.ArrayLike, tets: npt.ArrayLike, positions: npt.ArrayLike) -> Any:
    """A meshio.Mesh of the deformed positions (#V, 3), with the point array displacement_mm."""
    import meshio

    displacement = np.asarray(positions, dtype=np.float64) - np.asarray(points)
    return meshio.Mesh(np.asarray(positions), [("tetra", np.asarray(tets))], point_data={"displacement_mm": displacement})


def to_pyvista(points: npt.ArrayLike, tets: npt.ArrayLike, positions: npt.ArrayLike) -> Any:
    """A pyvista.UnstructuredGrid of the deformed positions (#V, 3), with the point array displacement_mm."""
    import pyvista

    grid = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: np.asarray(tets)}, np.asarray(positions))
    grid.point_data["displacement_mm"] = np.asarray(positions, dtype=np.float64) - np.asarray(points)
    return grid


def from_nibabel(image: Any) -> Volume:
    """The Volume of an image of nibabel: a CT in Hounsfield units or a label map. Errors: InvalidInput (not three axes)."""
    values = np.asanyarray(image.dataobj)
    if values.ndim != 3:
        raise InvalidInput(f"the image has {values.ndim} axes, not three", advice="take one volume of it")
    return Volume(values, image.affine, "RAS")
