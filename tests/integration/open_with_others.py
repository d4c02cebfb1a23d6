#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Whether programs that are not ours read from a mesh file what we read from it.

Usage: open_with_others.py [MESH OURS]

MESH is a file that Tissueform wrote; OURS what its own reader found there, as other_readers_test.cc writes it: a line
for each array, "SECTION NAME TYPE COMPONENTS COUNT" and then the bytes. VTK's Python module must find the same points,
cells and arrays, bit for bit, and so must meshio where it knows the format. Whoever reads with either must come upon the
notice. Exits with 77 where one of the modules is not installed, which is all that is looked for without a mesh.
"""

import pathlib
import sys

try:
    import meshio
    import numpy
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import VTK_TETRA, vtkPolyData
    from vtkmodules.vtkIOGeometry import vtkOBJReader, vtkSTLReader
    from vtkmodules.vtkIOPLY import vtkPLYReader
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader
except ModuleNotFoundError as missing:
    print(missing)
    sys.exit(77)

NOTICE = "not a medical device"


class Ours:
    """points, cells and two dictionaries of arrays by name."""

    def __init__(self, path):
        self.point_data = {}
        self.cell_data = {}
        data = path.read_bytes()
        while data:
            line, data = data.split(b"\n", 1)
            section, kind, components, count, name = line.decode().split(" ", 4)
            values = numpy.frombuffer(data, dtype=kind, count=int(count))
            data = data[values.nbytes:]
            if int(components) > 1:
                values = values.reshape(-1, int(components))
            if section in ("points", "cells"):
                setattr(self, section, values)
            else:
                getattr(self, section)[name] = values


def equal(what, theirs, ours):
    """The same shape, type and bits; a NaN is equal to itself."""
    if theirs.shape != ours.shape or theirs.dtype != ours.dtype or theirs.tobytes() != ours.tobytes():
        sys.exit(f"{what}: {theirs.dtype}{theirs.shape} is not {ours.dtype}{ours.shape} of our reader, or holds others")


def equal_arrays(what, theirs, ours):
    if sorted(theirs) != sorted(ours):
        sys.exit(f"{what}: arrays {sorted(theirs)} are not {sorted(ours)}")
    for name in ours:
        equal(f"{what} \"{name}\"", numpy.asarray(theirs[name]), ours[name])


def equal_corners(what, points, cells, ours, single):
    """For formats that keep no order of vertices, or number them anew: the places of every cell's corners."""
    precision = numpy.float32 if single else numpy.float64
    equal(f"{what} corners", points.astype(precision)[cells], ours.points.astype(precision)[ours.cells])


def refuse_without(what, notice):
    if NOTICE not in notice:
        sys.exit(f"{what}: there is no notice in \"{notice}\"")


def vtk_reader(path):
    makers = {
        ".vtu": vtkXMLUnstructuredGridReader,
        ".vtp": vtkXMLPolyDataReader,
        ".stl": vtkSTLReader,
        ".ply": vtkPLYReader,
        ".obj": vtkOBJReader,
    }
    return makers[path.suffix]() if path.suffix in makers else None


def check_vtk_arrays(grid, ours):
    def arrays(data):
        return {data.GetArray(i).GetName(): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}

    equal_arrays("VTK: point data", arrays(grid.GetPointData()), ours.point_data)
    equal_arrays("VTK: cell data", arrays(grid.GetCellData()), ours.cell_data)
    refuse_without("VTK", bytes(vtk_to_numpy(grid.GetFieldData().GetArray("notice"))).decode())


def check_vtk(path, ours):
    reader = vtk_reader(path)
    if reader is None:
        return
    errors = []
    reader.AddObserver("ErrorEvent", lambda *_: errors.append("error"))
    reader.SetFileName(str(path))
    reader.Update()
    if errors or reader.GetErrorCode() != 0:
        sys.exit(f"VTK: error {reader.GetErrorCode()}")
    grid = reader.GetOutput()
    points = vtk_to_numpy(grid.GetPoints().GetData())
    is_surface = isinstance(grid, vtkPolyData)
    corners = 3 if is_surface else 4
    cells = vtk_to_numpy((grid.GetPolys() if is_surface else grid.GetCells()).GetConnectivityArray()).reshape(-1, corners)
    if path.suffix in (".vtu", ".vtp"):
        equal("VTK: points", points, ours.points)
        equal("VTK: cells", cells.astype(numpy.int32), ours.cells)
        check_vtk_arrays(grid, ours)
    else:
        equal_corners("VTK", points, cells, ours, single=True)
    if not is_surface and set(vtk_to_numpy(grid.GetCellTypesArray())) != {VTK_TETRA}:
        sys.exit("VTK: there are cells that are no tets")
    if path.suffix == ".stl":
        refuse_without("VTK", vtk_to_numpy(reader.GetBinaryHeader()).tobytes().decode())


def check_meshio(path, ours):
    if path.suffix == ".vtp":
        return  # a format that meshio does not know
    mesh = meshio.read(path)
    block, = mesh.cells
    if block.type != ("tetra" if path.suffix == ".vtu" else "triangle"):
        sys.exit(f"meshio: cells are {block.type}")
    if path.suffix == ".vtu":
        equal("meshio: points", mesh.points, ours.points)
        equal("meshio: cells", block.data.astype(numpy.int32), ours.cells)
        equal_arrays("meshio: point data", mesh.point_data, ours.point_data)
        equal_arrays("meshio: cell data", {name: of_blocks[0] for name, of_blocks in mesh.cell_data.items()}, ours.cell_data)
        refuse_without("meshio", bytes(mesh.field_data["notice"]).decode())
    else:
        # STL holds single precision; of PLY our reader, which is VTK's, keeps no more.
        equal_corners("meshio", mesh.points, block.data, ours, single=path.suffix in (".stl", ".ply"))


def main(path, ours):
    check_vtk(path, ours)
    check_meshio(path, ours)
    refuse_without("the first bytes", path.read_bytes()[:400].decode("ascii", "replace"))


if __name__ == "__main__" and len(sys.argv) > 1:
    main(pathlib.Path(sys.argv[1]), Ours(pathlib.Path(sys.argv[2])))
