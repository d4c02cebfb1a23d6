# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""How much of the bundled CT's outer skin a plan's mesh has, by numpy and VTK alone.

    measure_coverage.py headsq_quarter.nhdr PLAN_FOLDER [X Y Z RADIUS_MM]

Prints the area (mm2) of the CT's skin and the share of it that lies within the tolerance of
PLAN_FOLDER/report.json from the mesh's boundary; with a ball, as if the mesh had nothing in it. It
shares no code with Tissueform, and works on the file's own voxels of 3.2 x 3.2 x 1.5 mm: nothing is
resampled, and no object is taken away, so 30 mm about the objects that the report names are left out.

Ends with 77 where numpy or VTK is missing.
"""

import gzip
import json
import pathlib
import sys

try:
    import numpy as np
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy
except ImportError:
    sys.exit(77)

SPACING = np.array([3.2, 3.2, 1.5])
TISSUE_ABOVE_HU = -500
BALL_MM = 6
CREASE_MM = 4


def read_ct(header):
    """HU with axes growing to the patient's left, back and head, and the first voxel's place."""
    raw = gzip.open(pathlib.Path(header).with_name("headsq_quarter.raw.gz")).read()
    values = np.frombuffer(raw, "<i2").reshape(93, 64, 64)[::-1, :, ::-1].astype(float) - 1024
    pad = 8
    origin = np.array([-3.2 * 63, 0, -1.5 * 92]) - pad * SPACING
    return np.pad(values, pad, mode="edge"), origin


def image_of(values, origin):
    image = vtk.vtkImageData()
    image.SetDimensions(*values.shape[::-1])
    image.SetSpacing(*SPACING)
    image.SetOrigin(*origin)
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(values, float).ravel(), deep=1))
    return image


def array_of(image, shape):
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(shape)


def distance_to_zero(mask):
    transform = vtk.vtkImageEuclideanDistance()
    transform.SetInputData(image_of(mask, np.zeros(3)))
    transform.ConsiderAnisotropyOn()
    transform.InitializeOn()
    transform.SetMaximumDistance(1e6)
    transform.Update()
    return np.sqrt(array_of(transform.GetOutput(), mask.shape))


def largest_part(mask):
    parts = vtk.vtkImageConnectivityFilter()
    parts.SetInputData(image_of(mask, np.zeros(3)))
    parts.SetScalarRange(0.5, 1.5)
    parts.SetExtractionModeToLargestRegion()
    parts.SetLabelModeToConstantValue()
    parts.Update()
    return array_of(parts.GetOutput(), mask.shape) > 0


def outside_air(hu):
    air = hu <= TISSUE_ABOVE_HU
    centres = largest_part(distance_to_zero(air) > BALL_MM)
    reached = air & (distance_to_zero(~centres) <= BALL_MM)
    return air & (distance_to_zero(~reached) <= CREASE_MM)


def triangles_of(poly):
    cells = vtk_to_numpy(poly.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vtk_to_numpy(poly.GetPoints().GetData()).astype(float), cells


def skin_of_ct(hu, origin, report):
    contour = vtk.vtkFlyingEdges3D()
    contour.SetInputData(image_of(hu, origin))
    contour.SetValue(0, TISSUE_ABOVE_HU)
    contour.Update()
    points, triangles = triangles_of(contour.GetOutput())
    corners = points[triangles]
    middles = corners.mean(axis=1)
    # Skin has outside air within a voxel of it.
    near = distance_to_zero(~outside_air(hu))
    index = np.rint((middles - origin) / SPACING).astype(int)
    inside = np.all((index >= 0) & (index < hu.shape[::-1]), axis=1)
    index = np.where(inside[:, None], index, 0)
    kept = inside & (near[index[:, 2], index[:, 1], index[:, 0]] <= SPACING.max())
    for plane in ("back", "above", "below"):
        region = report["region_of_interest"][plane]
        kept &= (middles - region["point_mm"]) @ np.array(region["normal"]) > SPACING.max()
    for thing in report["head"]["removed_objects"]:
        kept &= np.linalg.norm(middles - thing.get("skin_under_it_at_mm", thing["at_mm"]), axis=1) > 30
    corners = corners[kept]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    return middles[kept], areas


def boundary_of_mesh(path):
    """Faces that one tet alone has, with a corner that nothing holds."""
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    points = vtk_to_numpy(grid.GetPoints().GetData()).astype(float)
    tets = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4)
    faces = np.sort(np.concatenate([np.delete(tets, k, axis=1) for k in range(4)]), axis=1)
    faces, uses = np.unique(faces, axis=0, return_counts=True)
    faces = faces[uses == 1]
    anatomy = vtk_to_numpy(grid.GetPointData().GetArray("anatomy"))
    return points, faces[(anatomy[faces] == 0).any(axis=1)]


def distances(middles, points, faces):
    poly = vtk.vtkPolyData()
    vtk_points = vtk.vtkPoints()
    vtk_points.SetData(numpy_to_vtk(points, deep=1))
    poly.SetPoints(vtk_points)
    cells = vtk.vtkCellArray()
    for face in faces:
        cells.InsertNextCell(3, [int(v) for v in face])
    poly.SetPolys(cells)
    locator = vtk.vtkStaticCellLocator()
    locator.SetDataSet(poly)
    locator.BuildLocator()
    closest, cell, sub, squared = [0.0] * 3, vtk.reference(0), vtk.reference(0), vtk.reference(0.0)
    found = np.empty(len(middles))
    for k, middle in enumerate(middles):
        locator.FindClosestPoint(middle, closest, cell, sub, squared)
        found[k] = float(squared) ** 0.5
    return found


def main():
    header, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    report = json.loads((folder / "report.json").read_text())
    hu, origin = read_ct(header)
    middles, areas = skin_of_ct(hu, origin, report)
    points, faces = boundary_of_mesh(folder / "head.vtu")
    if len(sys.argv) > 3:
        *ball, radius = map(float, sys.argv[3:])
        far = np.linalg.norm(points[faces].mean(axis=1) - ball, axis=1) > radius
        faces = faces[far]
    covered = distances(middles, points, faces) <= report["coverage"]["tolerance_mm"]
    print(json.dumps({"area_mm2": areas.sum(), "share": areas[covered].sum() / areas.sum()}))


if __name__ == "__main__":
    main()
