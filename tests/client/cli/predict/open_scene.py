#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Whether VTK, meshio and an XML parser read an exported scene.

Usage: open_scene.py FOLDER

The predicted face must be the face moved by displacement_mm, and references within the scene must exist. Exits with 77
where a module is not installed.
"""

import pathlib
import sys
import xml.etree.ElementTree

try:
    import meshio
    import numpy
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader
except ModuleNotFoundError as missing:
    print(missing)
    sys.exit(77)


def face_of(path):
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    face = reader.GetOutput()
    arrays = face.GetPointData()
    return (vtk_to_numpy(face.GetPoints().GetData()), vtk_to_numpy(arrays.GetArray("displacement_mm")),
            vtk_to_numpy(arrays.GetArray("displacement_magnitude_mm")))


def main():
    folder = pathlib.Path(sys.argv[1])
    before, moved, length = face_of(folder / "face.vtp")
    after, moved_after, _ = face_of(folder / "face_predicted.vtp")
    assert len(before) > 1000 and numpy.abs(before + moved - after).max() < 1e-9
    assert numpy.array_equal(moved, moved_after)
    assert numpy.abs(numpy.linalg.norm(moved, axis=1) - length).max() < 1e-9 and length.max() > 3
    for path in folder.glob("*.ply"):
        mesh = meshio.read(path)
        assert len(mesh.points) > 100 and len(mesh.cells_dict["triangle"]) > 100, path
    jaw = meshio.read(folder / "mandible.ply").points.mean(axis=0)
    assert numpy.abs(jaw - before.mean(axis=0)).max() < 150

    root = xml.etree.ElementTree.parse(folder / "scene.mrml").getroot()
    assert root.tag == "MRML"
    ids = {node.get("id") for node in root}
    assert len(ids) == len(root)
    for node in root:
        assert node.get("id").startswith("vtkMRML" + node.tag + "Node"), node.tag
        for reference in filter(None, node.get("references", "").split(";")):
            target = reference.split(":")[1]
            assert target in ids or target.startswith("vtkMRMLColorTableNode"), target
        if node.tag in ("ModelStorage", "MarkupsJsonStorage"):
            assert node.get("coordinateSystem") == "LPS"
    assert any("transform:" in node.get("references", "") for node in root.iter("Model"))
    return 0


sys.exit(main())
