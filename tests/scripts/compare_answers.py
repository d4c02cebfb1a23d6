#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Compares the answers of two builds bit by bit, on this machine.

    tests/scripts/compare_answers.py [--revision REV] [--baseline BUILD] [--build BUILD]
                                     [--only PART,...] [--jobs N] [--keep DIR]

The other build is of --revision, by default the commit where this branch left origin/main, or else the one before
HEAD; it is built in build/compare_answers/REV and found there again. --baseline names a build folder that is there
already. --build is ours, build/release unless said.

Parts:
  data      the bundled plans and their meshes: the same JSON, the same arrays
  deform    all bundled plans by all models, and by every setting of gradient_field; their statistics without times
  run       all bundled plans through the tissueform-server of each build
  check     `mesh check --json` of all bundled meshes
  generate  `mesh generate` of closed surfaces: the tongue's skin and the pieces of bone of `build`
  build     `plan build` of the bundled CT with all bundled recipes

What is compared are the number arrays of results with their names and types, not the bytes of the files: a notice
or another encoding may change. Each build works on the tests/data of its own revision (say --revision too
with --baseline), so that rewritten data shows as well; plans that the other revision has not are given to both builds
as they are now. Needs Debian's python3-vtk9. Exit code 0: the same, 1: not, 2: wrong use.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from vtkmodules.vtkIOGeometry import vtkSTLReader
from vtkmodules.vtkIOPLY import vtkPLYWriter
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

ROOT = pathlib.Path(__file__).resolve().parents[2]
PARTS = ("data", "deform", "run", "check", "generate", "build")
RECIPE_CT = "ct/headsq/headsq_quarter.nhdr"
# Numbers that describe the run, not the answer.
OF_THE_RUN = re.compile(r"second|_ms$|_us$|time|memory|bytes|threads|^latency|version|commit")

MODELS = {
    "gradient_field": {},
    "gradient_field_uniform": {"guidance": "uniform"},
    "gradient_field_none": {"rotation": "none"},
    "gradient_field_estimated": {"rotation": "estimated"},
    "gradient_field_estimated_linear": {"rotation": "estimated", "blend": "linear", "max_iterations": 7},
    "gradient_field_estimated_uniform": {"rotation": "estimated", "guidance": "uniform"},
    "arap": None, "linear_elastic": None, "neo_hookean": None,
}


class Failure(Exception):
    """A command that did not do its work; the comparison goes on with the next."""


def run(words, cwd=None, codes=(0,)):
    done = subprocess.run([str(word) for word in words], cwd=cwd, capture_output=True, text=True)
    if done.returncode not in codes:
        last = (done.stderr.strip().splitlines() or [""])[-1]
        raise Failure(f"{' '.join(str(word) for word in words)}: exit code {done.returncode}: {last}")
    return done.stdout


# --- What is compared -----------------------------------------------------------------------------------------------

def chunks_of(path):
    """The chunks of a GLB file, by their type: the JSON text and the numbers (glTF 2.0, section 4.4)."""
    data, chunks, at = path.read_bytes(), {}, 12
    if data[:4] != b"glTF":
        raise Failure(f"{path}: not a GLB file")
    while at < len(data):
        length, kind = int.from_bytes(data[at:at + 4], "little"), data[at + 4:at + 8]
        chunks[kind], at = data[at + 8:at + 8 + length], at + 8 + length
    return chunks


def differences_of_scenes(before, now):
    old, new = chunks_of(before), chunks_of(now)
    yield from differences_of_json(*(json.loads(chunks[b"JSON"]) for chunks in (old, new)))
    if old[b"BIN\0"] != new[b"BIN\0"]:
        yield "the numbers of the scene differ"


def arrays_of(path):
    """All number arrays of a result, by name. A string array, as the notice is, is none."""
    reader = vtkSTLReader() if path.suffix == ".stl" else vtkXMLUnstructuredGridReader()
    if path.suffix == ".stl":
        reader.MergingOff()
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput()
    if data.GetNumberOfPoints() == 0:
        raise Failure(f"{path}: no points can be read")
    arrays = {"points": vtk_to_numpy(data.GetPoints().GetData())}
    if path.suffix != ".stl":
        arrays["cells"] = vtk_to_numpy(data.GetCells().GetConnectivityArray()).astype(numpy.int64)
    for kind, attributes in (("point", data.GetPointData()), ("cell", data.GetCellData())):
        for index in range(attributes.GetNumberOfArrays()):
            array = attributes.GetArray(index)
            if array is not None:
                arrays[f"{kind} array {array.GetName()}"] = vtk_to_numpy(array)
    return arrays


def differences_of_meshes(before, now):
    old, new = arrays_of(before), arrays_of(now)
    for name in sorted(set(old) | set(new)):
        if name not in old or name not in new:
            yield f"{name} is only {'now' if name in new else 'before'}"
        elif old[name].dtype != new[name].dtype or old[name].shape != new[name].shape:
            yield f"{name} was {old[name].dtype} {old[name].shape}, is {new[name].dtype} {new[name].shape}"
        elif old[name].tobytes() != new[name].tobytes():
            off = numpy.abs(old[name].astype(float) - new[name].astype(float))
            yield f"{name} differs in {numpy.count_nonzero(off)} numbers, by up to {numpy.nanmax(off):.3g}"


def differences_of_json(old, new, place=""):
    """What of `old` is not so in `new`; keys that are new are not asked for."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key, value in old.items():
            if OF_THE_RUN.search(key):
                continue
            if key not in new:
                yield f"{place}/{key} is only before"
            else:
                yield from differences_of_json(value, new[key], f"{place}/{key}")
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (before, now) in enumerate(zip(old, new)):
            yield from differences_of_json(before, now, f"{place}/{index}")
    elif old != new or type(old) is not type(new):
        yield f"{place} was {json.dumps(old)[:60]}, is {json.dumps(new)[:60]}"


def differences_of_files(before, now):
    if before.suffix == ".json":
        return differences_of_json(*(json.loads(path.read_text(encoding="utf-8")) for path in (before, now)))
    if before.suffix == ".glb":
        return differences_of_scenes(before, now)
    return differences_of_meshes(before, now)


# --- The two sides --------------------------------------------------------------------------------------------------

def without_field_data(path):
    """Writes the mesh again without what stands beside its arrays (the notice), which an older program may not read."""
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    reader.GetOutput().GetFieldData().Initialize()
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(reader.GetOutput())
    if writer.Write() != 1:
        raise Failure(f"cannot write {path}")


class Side:
    """A build, the data it works on, and the folder of its answers."""

    def __init__(self, name, build, data, out):
        self.name, self.data, self.out = name, data, out
        self.bin = build / "bin"
        for program in ("tissueform", "tissueform-server"):
            if not (self.bin / program).is_file():
                raise Failure(f"no program {self.bin / program}; build it, or name another build folder")

    def tissueform(self, *words, codes=(0,)):
        return run([self.bin / "tissueform", *words], cwd=self.data, codes=codes)

    def copy_of_plan(self, plan, other_data):
        """A folder of our own with a bundled plan, of the other revision when ours has none; where it lies."""
        source = next(d for d in (self.data, other_data) if (d / "plans" / plan / "plan.json").is_file())
        target = self.out / "plans" / plan
        if not target.is_dir():
            shutil.copytree(source / "plans" / plan, target)
            if source != self.data:
                for mesh in target.glob("*.vtu"):
                    without_field_data(mesh)
        return target


def plan_variant(folder, name, settings):
    """A copy of the folder's plan with another model."""
    plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
    plan["model"] = "gradient_field" if settings is not None else name
    if settings is not None:
        plan["gradient_field"] = {**plan.get("gradient_field", {}), **settings} if settings else plan.get("gradient_field", {})
    path = folder / f"{name}.plan.json"
    path.write_text(json.dumps(plan), encoding="utf-8")
    return path


def deform(side, plan, name, other_data):
    folder = side.copy_of_plan(plan, other_data)
    out = side.out / "deform" / f"{plan}-{name}.vtu"
    stats = out.with_suffix(".json")
    side.tissueform("deform", plan_variant(folder, name, MODELS[name]), "--threads", "2", "--out", out, "--stats", stats)
    written = json.loads(stats.read_text(encoding="utf-8"))
    for key in ("plan", "mesh", "out", "plan_sha256"):  # where files lie differs between the sides
        written.pop(key, None)
    stats.write_text(json.dumps(written), encoding="utf-8")
    return [out, stats]


def run_plans(side, plans, other_data):
    """All plans through one server of this side."""
    state = tempfile.TemporaryDirectory()  # where servers of today keep what they have; those before kept nothing
    server = subprocess.Popen([side.bin / "tissueform-server", "--port", "0"], stdout=subprocess.PIPE,
                              stderr=subprocess.DEVNULL, text=True, env={**os.environ, "XDG_STATE_HOME": state.name})
    try:
        lines = iter(server.stdout.readline, "")
        port = next((m.group(1) for m in (re.search(r"listening on \S+:(\d+)", line) for line in lines) if m), None)
        if port is None:
            raise Failure(f"{side.bin / 'tissueform-server'} ended before it listened")
        for plan in plans:
            side.tissueform("run", side.copy_of_plan(plan, other_data) / "plan.json", "--server", f"localhost:{port}",
                            "--out", side.out / "run" / f"{plan}.vtu")
    finally:
        server.terminate()
        server.wait()
    return [side.out / "run" / f"{plan}.vtu" for plan in plans]


def check(side, mesh):
    out = side.out / "check" / (mesh.replace("/", "-") + ".json")
    # An unusable mesh has exit code 1 and a report as well; one that is refused has no report.
    report = side.tissueform("mesh", "check", mesh, "--json", codes=(0, 1))
    out.write_text(report or '{"refused": true}', encoding="utf-8")
    return [out]


def generate(side, surface, options):
    out = side.out / "generate" / f"{surface.stem}.vtu"
    side.tissueform("mesh", "generate", surface, "--out", out, *options)
    return [out]


def plan_build(side, plan, other_data):
    folder = side.copy_of_plan(plan, other_data)
    out = side.out / "build" / plan
    side.tissueform("plan", "build", "--ct", side.data / RECIPE_CT, "--recipe", folder / "recipe.json", "--out", out,
                    "--threads", "2", "--no-pictures")
    return [out / "plan.json", out / "head.vtu", out / "report.json", *sorted(out.glob("segments/*.stl")), *out.glob("viewer.glb")]


def skin_of(mesh, path):
    """Writes the boundary of a mesh of tets as a surface."""
    reader, geometry, triangles, writer = (vtkXMLUnstructuredGridReader(), vtkGeometryFilter(), vtkTriangleFilter(),
                                           vtkPLYWriter())
    reader.SetFileName(str(mesh))
    geometry.SetInputConnection(reader.GetOutputPort())
    triangles.SetInputConnection(geometry.GetOutputPort())
    writer.SetInputConnection(triangles.GetOutputPort())
    writer.SetFileName(str(path))
    writer.Write()
    return path


class Comparison:
    """Runs one work on both sides and reports what differs."""

    def __init__(self, before, now):
        self.sides = (before, now)
        self.same, self.errors = 0, []

    def report(self, errors, title):
        self.errors += errors
        print(f"{'DIFFERENT' if errors else 'same':10} {title}", *(f"\n           {e}" for e in errors), sep="", flush=True)

    def files(self, title, befores, nows):
        errors = []
        if [path.name for path in befores] != [path.name for path in nows]:
            errors.append(f"files were {[p.name for p in befores]}, are {[p.name for p in nows]}")
        for before, now in zip(befores, nows):
            errors += [f"{now.name}: {difference}" for difference in differences_of_files(before, now)]
        self.same += not errors
        self.report(errors, title)

    def work(self, title, function, *arguments):
        try:
            befores, nows = (function(side, *arguments) for side in self.sides)
            self.files(title, befores, nows)
        except Failure as failure:
            self.report([str(failure)], title)


def works_of(parts, before, now, plans, scratch):
    """(title, function, arguments) of everything that both sides do, the longest first."""
    if "build" in parts:
        yield from ((f"plan build of {p}", plan_build, p, now.data) for p in plans
                    if (now.data / "plans" / p / "recipe.json").is_file())
    if "run" in parts:
        yield "all plans through the server", run_plans, plans, now.data
    if "deform" in parts:
        yield from ((f"deform {p}, {name}", deform, p, name, now.data) for p in plans for name in MODELS)
    if "generate" in parts:
        skin = skin_of(now.data / "plans/tongue/volumetricTongue.vtu", scratch / "tongue.ply")
        yield "mesh generate of the tongue's skin", generate, skin, []
        block = skin_of(now.data / "plans/block/block.vtu", scratch / "block.ply")
        yield "mesh generate of the block's skin, remeshed", generate, block, ["--remesh-mm", "6", "--edge-mm", "8"]
    if "check" in parts:
        names = (p.relative_to(now.data).as_posix() for p in sorted(now.data.glob("*/*/*"))
                 if p.suffix in (".vtu", ".vtk", ".msh", ".mesh", ".node", ".obj", ".ply", ".stl", ".off", ".vtp"))
        yield from ((f"mesh check {name}", check, name) for name in names if (before.data / name).is_file())


def compare(before, now, parts, jobs, scratch):
    comparison = Comparison(before, now)
    plans = sorted(p.parent.name for p in (now.data / "plans").glob("*/plan.json"))
    for side in (before, now):
        for part in PARTS:
            (side.out / part).mkdir(parents=True)
        for plan in plans:
            side.copy_of_plan(plan, now.data)
    if "data" in parts:
        for plan in plans:
            old, new = (sorted(p for p in (side.data / "plans" / plan).glob("*") if p.suffix in (".json", ".vtu"))
                        for side in (before, now))
            if old:
                comparison.files(f"data of {plan}", old, new)
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for done in [pool.submit(comparison.work, *work) for work in works_of(parts, before, now, plans, scratch)]:
            done.result()
    if "generate" in parts and "build" in parts:  # surfaces of `build`; the same for both sides
        for piece in sorted(before.out.glob("build/head*/segments/*.stl")):
            target = scratch / f"{piece.parents[1].name}-{piece.name}"
            shutil.copy(piece, target)
            comparison.work(f"mesh generate of {target.name}", generate, target, ["--remesh-mm", "3", "--edge-mm", "5"])
    return comparison


# --- The other revision ---------------------------------------------------------------------------------------------

def git(*words):
    return run(["git", "-C", ROOT, *words]).strip()


def revision_before():
    head = git("rev-parse", "HEAD")
    try:
        base = git("merge-base", "HEAD", "origin/main")
    except Failure:
        base = head
    return base if base != head else git("rev-parse", "HEAD~")


def unpack(revision, folder, *paths):
    folder.mkdir(parents=True, exist_ok=True)
    archive = subprocess.run(["git", "-C", ROOT, "archive", revision, *paths], check=True, stdout=subprocess.PIPE)
    subprocess.run(["tar", "-x", "-C", folder], check=True, input=archive.stdout)


def build_of(revision):
    """The build folder of a commit, made when it is not there."""
    folder = ROOT / "build" / "compare_answers" / git("rev-parse", "--short=12", revision)
    if not (folder / "done").is_file():
        print(f"building {revision} in {folder}", flush=True)
        shutil.rmtree(folder, ignore_errors=True)
        unpack(revision, folder / "tree")
        subprocess.run(["cmake", "--preset", "release", "-B", folder / "build", "-DBUILD_TESTING=OFF"],
                       cwd=folder / "tree", check=True, stdout=subprocess.DEVNULL)
        subprocess.run(["cmake", "--build", folder / "build", "--target", "tissueform", "tissueform-server"], check=True)
        (folder / "done").touch()
    return folder / "build"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--revision", help="the commit to compare with")
    parser.add_argument("--baseline", type=pathlib.Path, help="a build folder of that commit")
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release", help="our build folder")
    parser.add_argument("--only", default=",".join(PARTS), help="parts, with commas between them: " + ", ".join(PARTS))
    parser.add_argument("--jobs", type=int, default=2, help="programs at once")
    parser.add_argument("--keep", type=pathlib.Path, help="keep all answers in this new folder")
    arguments = parser.parse_args()
    parts = arguments.only.split(",")
    if set(parts) - set(PARTS) or arguments.jobs < 1:
        parser.error(f"--only takes {', '.join(PARTS)}; --jobs at least 1")
    try:
        revision = arguments.revision or revision_before()
        build = arguments.baseline or build_of(revision)
        with tempfile.TemporaryDirectory() as temporary:
            scratch = arguments.keep or pathlib.Path(temporary)
            scratch.mkdir(parents=True, exist_ok=True)
            scratch = scratch.resolve()
            unpack(revision, scratch / "data_before", "tests/data")
            before = Side("before", build.resolve(), scratch / "data_before/tests/data", scratch / "before")
            now = Side("now", arguments.build.resolve(), ROOT / "tests/data", scratch / "now")
            comparison = compare(before, now, parts, arguments.jobs, scratch)
    except (Failure, OSError, subprocess.CalledProcessError) as error:
        print(f"compare_answers.py: {error}", file=sys.stderr)
        return 2
    print(f"{comparison.same} answers are the same as those of {revision}, {len(comparison.errors)} differences")
    return 1 if comparison.errors else 0


if __name__ == "__main__":
    sys.exit(main())
