#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Fills damaged surfaces with and without `--wrap-mm` and prints a table.

usage: measure_wrapping.py TISSUEFORM [FOLDER_OF_SURFACES...]

Surfaces are those in the folders (.obj .stl .ply .off .vtp, at any depth) and a set that is
generated here. VTK, which shares no code with the wrap, checks that the boundary of every mesh is
closed and manifold. Exit code 1: a surface crashed the program, a mesh is not closed, or a wrap is
farther from its surface than offset and alpha.
"""
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

import vtk

ENDINGS = {".obj", ".stl", ".ply", ".off", ".vtp"}
ALPHA_PER_OFFSET = 3  # core/mesh/generation/surface_wrapping.h
OFFSET_OF_DIAGONAL = 0.005


def sphere(rows=24, radius=20.0, center=(0.0, 0.0, 0.0)):
    points = [(0.0, 0.0, radius), (0.0, 0.0, -radius)]
    for i in range(1, rows):
        for j in range(2 * rows):
            t, p = math.pi * i / rows, math.pi * j / rows
            points.append((radius * math.sin(t) * math.cos(p), radius * math.sin(t) * math.sin(p),
                           radius * math.cos(t)))
    at = lambda i, j: 2 + (i - 1) * 2 * rows + j % (2 * rows)
    faces = []
    for j in range(2 * rows):
        faces += [(0, at(1, j), at(1, j + 1)), (1, at(rows - 1, j + 1), at(rows - 1, j))]
        for i in range(1, rows - 1):
            faces += [(at(i, j), at(i + 1, j), at(i + 1, j + 1)),
                      (at(i, j), at(i + 1, j + 1), at(i, j + 1))]
    return [tuple(a + b for a, b in zip(p, center)) for p in points], faces


def joined(first, second):
    shift = len(first[0])
    return (first[0] + second[0],
            first[1] + [tuple(v + shift for v in f) for f in second[1]])


def generated():
    """Names and surfaces, each with one kind of damage."""
    rng = random.Random(7)
    points, faces = sphere()
    some = set(rng.sample(range(len(faces)), 60))
    yield "sphere", (points, faces)
    yield "60 triangles missing", (points, [f for i, f in enumerate(faces) if i not in some])
    yield "60 triangles turned", (points, [f[::-1] if i in some else f
                                           for i, f in enumerate(faces)])
    yield "60 triangles twice", (points, faces + [faces[i] for i in sorted(some)])
    yield "inside out", (points, [f[::-1] for f in faces])
    yield "corners not joined", ([points[v] for f in faces for v in f],
                                 [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(len(faces))])
    yield "noise of 0.6 mm", ([tuple(x + rng.gauss(0, 0.6) for x in p) for p in points], faces)
    yield "two overlap", joined((points, faces), sphere(center=(15.0, 3.0, 2.0)))
    yield "two touch", joined((points, faces), sphere(center=(40.0, 0.0, 0.0)))
    yield "one inside the other", joined((points, faces), sphere(radius=10.0))
    yield "fin of three triangles", (points + [(0.0, 0.0, 30.0)],
                                     faces + [(0, faces[4][1], len(points))])
    yield "slivers", (points + [(0.0, 0.0, 20.0 + 1e-9)], faces + [(0, 2, len(points))])
    yield "five parts", joined(sphere(12, 8.0, (0, 0, 40)), joined(sphere(12, 8.0, (30, 0, 0)),
        joined(sphere(12, 8.0, (0, 30, 0)), joined(sphere(12, 8.0), sphere(12, 8.0, (4, 4, 4))))))


def write_off(path, surface):
    points, faces = surface
    lines = [f"OFF\n{len(points)} {len(faces)} 0"]
    lines += ["%.9g %.9g %.9g" % p for p in points] + ["3 %d %d %d" % f for f in faces]
    path.write_text("\n".join(lines) + "\n")


def diagonal(path):
    """None where the file has no triangles that VTK can read."""
    readers = {".obj": vtk.vtkOBJReader, ".stl": vtk.vtkSTLReader, ".ply": vtk.vtkPLYReader,
               ".vtp": vtk.vtkXMLPolyDataReader}
    if path.suffix == ".off":
        rows = [line.split() for line in path.read_text().splitlines()[2:]]
        points = [[float(x) for x in row] for row in rows if len(row) == 3]
        return math.dist([min(c) for c in zip(*points)], [max(c) for c in zip(*points)])
    reader = readers[path.suffix]()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput().GetLength() or None


def open_edges(mesh):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(mesh))
    skin = vtk.vtkDataSetSurfaceFilter()
    skin.SetInputConnection(reader.GetOutputPort())
    edges = vtk.vtkFeatureEdges()
    edges.SetInputConnection(skin.GetOutputPort())
    edges.FeatureEdgesOff()
    edges.ManifoldEdgesOff()
    edges.Update()
    return edges.GetOutput().GetNumberOfCells()


def run(program, surface, folder, *options):
    mesh = folder / "mesh.vtu"
    mesh.unlink(missing_ok=True)
    done = subprocess.run([program, "mesh", "generate", surface, "--out", mesh, "--json", *options],
                          capture_output=True, text=True, timeout=900, check=False)
    if done.returncode not in (0, 1):
        raise SystemExit(f"{surface}: exit code {done.returncode}: {done.stderr}")
    return done, mesh


def row(program, name, surface, folder):
    """A line of the table, whether it was filled without and with a wrap, and whether all holds."""
    plain, _ = run(program, surface, folder)
    length = diagonal(surface)
    if not length:
        return f"| {name} | not readable | | | |", False, False, True
    offset = float(f"{OFFSET_OF_DIAGONAL * length:.2g}")
    wrapped, mesh = run(program, surface, folder, "--wrap-mm", str(offset))
    if wrapped.returncode != 0:
        return f"| {name} | {plain.returncode == 0} | {offset:g} | refused | |", False, False, True
    wrap = json.loads(wrapped.stdout)["wrapping"]
    sound = (open_edges(mesh) == 0 and
             wrap["largest_to_surface_mm"] <= (1 + ALPHA_PER_OFFSET) * offset)
    text = (f"| {name} | {'filled' if plain.returncode == 0 else 'refused'} | {offset:g} | "
            f"{wrap['largest_to_surface_mm'] / offset:.2f} | {wrap['covered_fraction']:.0%}"
            f"{', sheet' if wrap['is_sheet'] else ''} |")
    return text, plain.returncode == 0, True, sound


def main():
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    program = sys.argv[1]
    print("| surface | without | offset, mm | wrap to surface, offsets | covered |\n"
          "| --- | --- | --- | --- | --- |")
    results = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        surfaces = []
        for name, surface in generated():
            surfaces.append((name, folder / (name.replace(" ", "_") + ".off")))
            write_off(surfaces[-1][1], surface)
        for argument in sys.argv[2:]:
            surfaces += [(path.name, path) for path in sorted(pathlib.Path(argument).rglob("*"))
                         if path.suffix in ENDINGS]
        for name, surface in surfaces:
            text, *result = row(program, name, surface, folder)
            print(text, flush=True)
            results.append(result)
    plain, wrapped, sound = (sum(column) for column in zip(*results))
    print(f"\n{len(results)} surfaces: {plain} filled without a wrap, {wrapped} with one, "
          f"{len(results) - sound} unsound")
    return 0 if sound == len(results) else 1


if __name__ == "__main__":
    sys.exit(main())
