#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Whether VTK's glTF reader finds in a case the surfaces that are in it.

Usage: open_case_with_vtk.py [CASE.glb OURS]

OURS has a line for each surface, in their order: points, triangles, and the box about them in mm and LPS as "low x,
high x, low y, ..". In glTF's axes, metres with y up and the face along z, VTK must find the same. Exits with 77 where
VTK's module is not installed, which is all that is looked for without a file.
"""

import pathlib
import sys

try:
    from vtkmodules.vtkIOGeometry import vtkGLTFReader
except ModuleNotFoundError as missing:
    print(missing)
    sys.exit(77)


def surfaces_of(path):
    reader = vtkGLTFReader()
    reader.SetFileName(path)
    reader.ApplyDeformationsToGeometryOn()
    reader.Update()
    blocks = reader.GetOutput()
    found = blocks.NewIterator()
    while not found.IsDoneWithTraversal():
        yield found.GetCurrentDataObject()
        found.GoToNextItem()


def main():
    if len(sys.argv) < 3:
        return 0
    surfaces = list(surfaces_of(sys.argv[1]))
    lines = pathlib.Path(sys.argv[2]).read_text().splitlines()
    if len(surfaces) != len(lines) or not surfaces:
        print(f"VTK finds {len(surfaces)} surfaces, we {len(lines)}")
        return 1
    for surface, line in zip(surfaces, lines):
        points, triangles, *box = line.split()
        x0, x1, y0, y1, z0, z1 = (float(number) / 1000 for number in box)
        if (surface.GetNumberOfPoints(), surface.GetNumberOfPolys()) != (int(points), int(triangles)):
            print(f"VTK finds {surface.GetNumberOfPoints()} points, we {points}")
            return 1
        ours = (x0, x1, z0, z1, -y1, -y0)
        if max(abs(a - b) for a, b in zip(surface.GetBounds(), ours)) > 1e-6:
            print(f"VTK finds it at {surface.GetBounds()}, we at {ours}")
            return 1
    return 0


sys.exit(main())
