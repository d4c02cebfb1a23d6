#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Writes the files of this folder by meshio and by VTK: two tets among a vertex, lines, triangles and a quad.

Vertices 5 to 7 belong to faces only. Cell array `part`: the number of the cell; `triple`: it, its half and its negative.
"""

import meshio
import numpy
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkIdList, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
from vtkmodules.vtkIOLegacy import vtkUnstructuredGridWriter
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

POINTS = numpy.array([[0, 0, 0], [1.5, 0, 0.125], [0, 2.25, 0], [0.125, 0.25, 3], [2, 2.5, 3.5], [9, 0, 0], [9, 1, 0], [9, 1, 1]])
CELLS = [
    ("triangle", [5, 6, 7]),
    ("tetra", [0, 1, 2, 3]),
    ("line", [0, 1]),
    ("line", [1, 2]),
    ("quad", [0, 5, 6, 7]),
    ("tetra", [1, 2, 3, 4]),
    ("vertex", [4]),
]
VTK_TYPES = {"vertex": 1, "line": 3, "triangle": 5, "quad": 9, "tetra": 10}


def by_meshio():
    part = [[i] for i in range(len(CELLS))]
    triple = [[[i, i / 2, -i]] for i in range(len(CELLS))]
    mesh = meshio.Mesh(
        POINTS,
        [(kind, [corners]) for kind, corners in CELLS],
        point_data={"number": numpy.arange(8.0)},
        cell_data={"part": part, "triple": triple},
    )
    mesh.write("meshio.vtu")
    mesh.write("meshio.vtk")


def by_vtk():
    grid = vtkUnstructuredGrid()
    points = vtkPoints()
    points.SetData(numpy_to_vtk(POINTS, deep=True))
    grid.SetPoints(points)
    for kind, corners in CELLS:
        ids = vtkIdList()
        for corner in corners:
            ids.InsertNextId(corner)
        grid.InsertNextCell(VTK_TYPES[kind], ids)

    def add(data, name, values):
        array = numpy_to_vtk(numpy.asarray(values), deep=True)
        array.SetName(name)
        data.AddArray(array)

    add(grid.GetPointData(), "number", numpy.arange(8.0))
    add(grid.GetCellData(), "part", numpy.arange(7, dtype=numpy.int32))
    add(grid.GetCellData(), "triple", [[i, i / 2, -i] for i in range(7)])
    for writer, name, ascii_or_binary in (
        (vtkUnstructuredGridWriter(), "vtk_ascii.vtk", "SetFileTypeToASCII"),
        (vtkUnstructuredGridWriter(), "vtk_binary.vtk", "SetFileTypeToBinary"),
        (vtkXMLUnstructuredGridWriter(), "vtk.vtu", "SetDataModeToAscii"),
    ):
        getattr(writer, ascii_or_binary)()
        writer.SetInputData(grid)
        writer.SetFileName(name)
        writer.Write()


by_meshio()
by_vtk()
