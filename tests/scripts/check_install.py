#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Installs a build and checks that what is installed works by itself.

    tests/scripts/check_install.py BUILD [--keep-paths]

Installs into a scratch folder, moves the tree to another place, hides the source and the build folder where the
system lets us (unshare), and then: no file knows where it was built (unless --keep-paths: a build with debug
information or sanitizers); programs answer, read meshes, predict, build a plan and drag through their server;
docs/examples/drag is built with find_package(tissueform) alone and drags through the installed server; manual pages
are there. Exit code 0 when all is so.
"""

import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def run(*words, env=None):
    done = subprocess.run([str(word) for word in words], env=env, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(str(word) for word in words)}: exit code {done.returncode}\n"
                           f"{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return done.stdout


def check(condition, what):
    if not condition:
        raise RuntimeError(what)
    print(f"ok: {what}", flush=True)


def install(build, place):
    """Installs beside `place` and moves the tree there, so that nothing can rest on where it was put first."""
    first = place.with_name("first")
    run("cmake", "--install", build, "--prefix", first)
    first.rename(place)


def check_paths(prefix, build):
    for folder in (ROOT, build):
        found = subprocess.run(["grep", "-rlF", "--", str(folder), prefix], capture_output=True, text=True).stdout
        check(not found, f"no installed file knows {folder.name}" + (f", but: {found}" if found else ""))
    for program in [*prefix.glob("bin/*"), *prefix.glob("libexec/*/*")]:
        dynamic = run("readelf", "-d", program)
        check("RPATH" not in dynamic and "RUNPATH" not in dynamic, f"{program.name} looks for libraries where all do")


def check_programs(prefix, scratch):
    program, plans = prefix / "bin/tissueform", prefix / "share/tissueform/plans"
    check(re.match(r"tissueform \d", run(program, "--version")), "tissueform --version")
    run(program, "mesh", "check", plans / "tongue/volumetricTongue.vtu")
    run(program, "deform", plans / "bar/plan.json", "--out", scratch / "bar.vtu")
    check((scratch / "bar.vtu").is_file(), "mesh check and deform")
    demo = scratch / "demo"
    run(program, "demo", "--no-browser", "--seconds", "0.2", "--out", demo)
    check((demo / "result.vtu").is_file(), "demo, through the installed server")
    if shutil.which("Xvfb"):
        check((demo / "front.png").is_file(), "pictures, under the installed guard")
    # Formats whose libraries lie in modules or helper programs.
    run(program, "mesh", "check", demo / "skin.stl")
    gmsh = scratch / "tet.msh"
    gmsh.write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
                    "$Elements\n1\n1 4 2 1 1 1 2 3 4\n$EndElements\n", encoding="utf-8")
    check('"tets": 1' in run(program, "mesh", "check", gmsh, "--json"), "meshes of STL and Gmsh")
    cube = scratch / "cube.off"
    cube.write_text("OFF\n8 12 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n3 0 2 1\n3 0 3 2\n3 4 5 6\n"
                    "3 4 6 7\n3 0 1 5\n3 0 5 4\n3 1 2 6\n3 1 6 5\n3 2 3 7\n3 2 7 6\n3 3 0 4\n3 3 4 7\n", encoding="utf-8")
    run(program, "mesh", "generate", cube, "--out", scratch / "cube.vtu")
    check((scratch / "cube.vtu").is_file(), "mesh generate")
    run(program, "plan", "build", "--ct", scratch / "ct/headsq_quarter.nhdr", "--recipe", plans / "head/recipe.json",
        "--out", scratch / "head", "--no-pictures")
    check((scratch / "head/plan.json").is_file(), "plan build")
    lab = subprocess.run([program, "bench"], capture_output=True, text=True)
    check(lab.returncode == 1 and "not installed here" in lab.stderr and "bench" not in run(program, "--help"), "the laboratory is not installed, and `bench` says so")


def check_example(prefix, scratch):
    source, build = prefix / "share/doc/tissueform/examples/drag", scratch / "example"
    run("cmake", "-S", source, "--preset", "release", "-B", build, env=os.environ | {"TISSUEFORM_PREFIX": str(prefix)})
    run("cmake", "--build", build)
    server = subprocess.Popen([prefix / "bin/tissueform-server", "--in-memory", "--port", "0"], stdout=subprocess.PIPE,
                              stderr=subprocess.DEVNULL, text=True)
    try:
        line = server.stdout.readline()
        check(line.startswith("listening on "), "the installed server listens")
        frames = run(build / "drag", line.split()[-1]).splitlines()
    finally:
        server.terminate()
        server.wait()
    last = [float(number) for number in re.findall(r"-?[\d.]+", frames[-1])]
    # Half way up a bar whose other end stays: the middle goes half as far, and by symmetry nowhere else.
    check(len(frames) == 10 and abs(last[1] - 15) < 0.5 and abs(last[2] - 10) < 0.01,
          f"the example drags: {frames[-1]}")


def check_pages(prefix):
    pages = [page.stem for page in sorted(prefix.glob("share/man/man1/*.1"))]
    check({"tissueform", "tissueform-server", "tissueform-mesh-check"} <= set(pages), f"{len(pages)} manual pages")


def check_hidden(prefix, scratch):
    """All that needs neither source nor build folder."""
    check_programs(prefix, scratch)
    check_example(prefix, scratch)


def can_hide():
    return subprocess.run(["unshare", "-m", "true"], capture_output=True).returncode == 0


def hide_and_check(build, scratch):
    """Runs check_hidden in a mount namespace where empty folders lie over the source and the build folder."""
    script = 'for folder in "${@:3}"; do mount -t tmpfs none "$folder"; done; cd /; exec "$0" "$1" --hidden "$2"'
    copy = shutil.copy(__file__, scratch / "check_install.py")
    folders = [ROOT] if build.is_relative_to(ROOT) else [build, ROOT]
    return subprocess.run(["unshare", "-m", "bash", "-euc", script, sys.executable, copy, scratch, *folders]).returncode


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--hidden", action="store_true", help=argparse.SUPPRESS)  # `build` is then the scratch folder
    parser.add_argument("--keep-paths", action="store_true", help="the build has debug information, which knows paths")
    arguments = parser.parse_args()
    build = arguments.build.resolve()
    try:
        if arguments.hidden:
            check_hidden(build / "moved", build)
            return 0
        with tempfile.TemporaryDirectory(prefix="tissueform-install-") as temporary:
            scratch = pathlib.Path(temporary)
            shutil.copytree(ROOT / "tests/data/ct/headsq", scratch / "ct")
            install(build, scratch / "moved")
            if not arguments.keep_paths:
                check_paths(scratch / "moved", build)
            check_pages(scratch / "moved")
            if can_hide():
                return hide_and_check(build, scratch)
            print("source and build folder stay visible: unshare is not allowed here")
            check_hidden(scratch / "moved", scratch)
    except (OSError, RuntimeError) as error:
        print(f"check_install.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
