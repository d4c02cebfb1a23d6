#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Writes golden_slices.json with VTK: slices by vtkImageReslice, and lines by vtkCutter.

    client/web/tests/slices/golden_slices.py > client/web/tests/slices/golden_slices.json

The volume and the mesh are formulas, which golden_scene.ts repeats.
"""

import json
import sys

import numpy as np
import vtk
from vtk.util import numpy_support

SIZE = (23, 19, 17)
SPACING = (0.7, 1.1, 2.3)
ORIGIN = np.array([-12.5, 4.25, -30.75])
PIXELS = (48, 40)
PIXEL_MM = 0.6
RINGS, SIDES = 40, 24


def rotation(x, y, z):
    angle = np.linalg.norm((x, y, z))
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / angle
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def volume():
    k, j, i = np.meshgrid(*(np.arange(n, dtype=np.int64) for n in reversed(SIZE)), indexing="ij")
    values = (((i * 73856093) ^ (j * 19349663) ^ (k * 83492791)) & 0x7FF) - 1024
    image = vtk.vtkImageData()
    image.SetDimensions(SIZE)
    image.SetSpacing(SPACING)
    array = numpy_support.numpy_to_vtk(values.astype(np.int16).ravel(), deep=True)
    image.GetPointData().SetScalars(array)
    return image


def reslice(image, directions, right, down, middle):
    """Pixels whose first one is `PIXELS / 2` pixels left and above of `middle`; -32768 outside."""
    first = middle - 0.5 * PIXEL_MM * (PIXELS[0] * right + PIXELS[1] * down)
    axes = np.eye(4)
    for column, vector in enumerate((right, down, np.cross(right, down))):
        axes[:3, column] = directions.T @ vector
    axes[:3, 3] = directions.T @ (first - ORIGIN)
    matrix = vtk.vtkMatrix4x4()
    matrix.DeepCopy(axes.ravel())
    filter_ = vtk.vtkImageReslice()
    filter_.SetInputData(image)
    filter_.SetResliceAxes(matrix)
    filter_.SetInterpolationModeToLinear()
    filter_.SetOutputScalarType(vtk.VTK_FLOAT)
    filter_.SetOutputDimensionality(2)
    filter_.SetOutputSpacing(PIXEL_MM, PIXEL_MM, 1)
    filter_.SetOutputOrigin(0, 0, 0)
    filter_.SetOutputExtent(0, PIXELS[0] - 1, 0, PIXELS[1] - 1, 0, 0)
    filter_.SetBackgroundLevel(-32768)
    filter_.Update()
    values = numpy_support.vtk_to_numpy(filter_.GetOutput().GetPointData().GetScalars())
    return [round(float(value), 3) for value in values]


def torus():
    ring, side = np.meshgrid(np.arange(RINGS), np.arange(SIDES), indexing="ij")
    u, v = 2 * np.pi * ring / RINGS, 2 * np.pi * side / SIDES
    tube = 8 + 2 * np.sin(5 * u)
    points = np.stack([(25 + tube * np.cos(v)) * np.cos(u), (25 + tube * np.cos(v)) * np.sin(u), tube * np.sin(v)], axis=-1)
    at = lambda r, s: (r % RINGS) * SIDES + s % SIDES
    triangles = []
    for r in range(RINGS):
        for s in range(SIDES):
            triangles += [(at(r, s), at(r + 1, s), at(r + 1, s + 1)), (at(r, s), at(r + 1, s + 1), at(r, s + 1))]
    return points.reshape(-1, 3).astype(np.float32), triangles


def cut(points, triangles, origin, normal):
    """Each line of the cut: six numbers."""
    data, vtk_points, cells = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray()
    for point in points:
        vtk_points.InsertNextPoint(*map(float, point))
    for triangle in triangles:
        cells.InsertNextCell(3, triangle)
    data.SetPoints(vtk_points)
    data.SetPolys(cells)
    plane = vtk.vtkPlane()
    plane.SetOrigin(*origin)
    plane.SetNormal(*normal)
    cutter = vtk.vtkCutter()
    cutter.SetInputData(data)
    cutter.SetCutFunction(plane)
    cutter.Update()
    output = cutter.GetOutput()
    lines = []
    for index in range(output.GetNumberOfLines()):
        cell = output.GetCell(index)
        lines.append([round(c, 4) for k in (0, 1) for c in output.GetPoint(cell.GetPointId(k))])
    return lines


def main():
    directions, axes = rotation(0.3, -0.5, 0.8), rotation(0.1, 0.2, -0.15)
    image = volume()
    middle = ORIGIN + directions @ (np.array(SPACING) * (np.array(SIZE) - 1) * (0.45, 0.55, 0.52))
    left, posterior, superior = axes.T
    planes = {"axial": (left, posterior), "coronal": (left, -superior), "sagittal": (posterior, -superior)}
    slices = {name: reslice(image, directions, right, down, middle) for name, (right, down) in planes.items()}
    normals = {"flat": (0, 0, 1), "across": (1, 0, 0), "oblique": (0.48, 0.6, 0.64)}
    cuts = {name: cut(*torus(), (3.3, -1.7, 0.9), normal) for name, normal in normals.items()}
    json.dump({"middle": list(middle), "slices": slices, "cuts": cuts}, sys.stdout, separators=(",", ":"))
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
