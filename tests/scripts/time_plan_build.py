#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Times `tissueform plan build` by stage, against an older build when one is named.

    tests/scripts/time_plan_build.py [--ct CT --recipe RECIPE] [--bin FOLDER] [--baseline FOLDER]
                                     [--repetitions N] [--threads N] [--json FILE]

The folders hold the programs of a build (build/release/bin unless said). The builds take turns, so that what else the
machine does hits both, and medians are compared; ratios are medians of the ratios of turns. Without --ct it is the
bundled head. Stages whose name has "metal" in it are apart: they are new work, and their time is taken off the wall
time in a row of its own.

--json keeps all of it with the machine, the compiler, the commit of this tree and what --note says, and the numbers
of quality from both reports side by side. Exit code 0, or 1 when a build fails (a plan that is not ready is none).
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

SOURCE = pathlib.Path(__file__).resolve().parents[2]
QUALITY = {
    "vertices": ("mesh", "vertices"),
    "tets": ("mesh", "tets"),
    "inverted_tets": ("mesh", "inverted_tets"),
    "smallest_dihedral_deg": ("mesh", "smallest_dihedral_deg"),
    "tets_below_10_deg": ("mesh", "tets_below_10_deg"),
    "tets_below_5_deg": ("mesh", "tets_below_5_deg"),
    "skin_to_ct_mean_mm": ("distances", "skin_to_ct", "mean_mm"),
    "skin_to_ct_p99_mm": ("distances", "skin_to_ct", "p99_mm"),
    "isosurface_to_mesh_mean_mm": ("distances", "isosurface_to_boundary", "mean_mm"),
    "isosurface_to_mesh_p99_mm": ("distances", "isosurface_to_boundary", "p99_mm"),
    "isosurface_to_mesh_max_mm": ("distances", "isosurface_to_boundary", "max_mm"),
    "covered_share": ("coverage", "whole", "covered_share"),
    "freed_by_contact": ("regions", "freed_by_contact"),
}


def build_once(programs, options, accept_defects):
    """Seconds (wall, processor and by stage), memory and quality of one build."""
    with tempfile.TemporaryDirectory() as folder:
        command = [programs / "tissueform", "plan", "build", "--ct", options.ct, "--recipe", options.recipe,
                   "--out", f"{folder}/plan", "--stats", f"{folder}/stats.json", "--threads", str(options.threads),
                   "--no-pictures"] + (["--accept-defects"] if accept_defects else [])
        with open(f"{folder}/output", "w", encoding="utf-8") as output:
            begin = time.perf_counter()
            process = subprocess.Popen(command, stdout=output, stderr=output)
            _, status, usage = os.wait4(process.pid, 0)
            wall = time.perf_counter() - begin
            process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            sys.exit(f"{programs}: {pathlib.Path(folder, 'output').read_text(encoding='utf-8')[-600:]}")
        stats = json.loads(pathlib.Path(folder, "stats.json").read_text(encoding="utf-8"))
        report = json.loads(pathlib.Path(folder, "plan/report.json").read_text(encoding="utf-8"))
    seconds = {"wall": wall, "processor": usage.ru_utime + usage.ru_stime}
    metal = 0.0
    for stage in stats["stages"]:
        seconds[stage["stage"]] = seconds.get(stage["stage"], 0.0) + stage["seconds"]
        metal += stage["seconds"] if "metal" in stage["stage"] else 0.0
    seconds["wall without metal"] = wall - metal
    return {"seconds": seconds, "peak_bytes": stats["peak_bytes"], "quality": quality_of(report)}


def quality_of(report):
    values = {}
    for name, path in QUALITY.items():
        value = report
        for key in path:
            value = value.get(key) if isinstance(value, dict) else None
        values[name] = value
    return values


def medians(runs):
    return {name: statistics.median(run["seconds"][name] for run in runs) for name in runs[0]["seconds"]}


def ratios(ours, theirs):
    shared = [name for name in ours[0]["seconds"] if name in theirs[0]["seconds"]]
    return {name: statistics.median(b["seconds"][name] / max(a["seconds"][name], 1e-9)
                                    for a, b in zip(theirs, ours, strict=True)) for name in shared}


def knows_defects(programs):
    output = subprocess.run([programs / "tissueform", "plan", "build", "--help"], capture_output=True, text=True,
                          check=True)
    return "--accept-defects" in output.stdout


def machine():
    models = [line.split(": ", 1)[1].strip() for line in open("/proc/cpuinfo", encoding="utf-8")
              if line.startswith("model name")]
    return f"{models[0] if models else 'unknown processor'}, {len(os.sched_getaffinity(0))} processors"


def first_line(command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ct", default=SOURCE / "tests/data/ct/headsq/headsq_quarter.nhdr", type=pathlib.Path)
    parser.add_argument("--recipe", default=SOURCE / "tests/data/plans/head/recipe.json", type=pathlib.Path)
    parser.add_argument("--bin", default=SOURCE / "build/release/bin", type=pathlib.Path)
    parser.add_argument("--baseline", type=pathlib.Path)
    parser.add_argument("--repetitions", default=3, type=int)
    parser.add_argument("--threads", default=2, type=int)
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--note", default="")
    options = parser.parse_args()
    if options.repetitions < 1:
        parser.error("--repetitions is 1 or more")

    builds = {"ours": options.bin} | ({"baseline": options.baseline} if options.baseline else {})
    runs = {name: [] for name in builds}
    for _ in range(options.repetitions):
        for name, programs in builds.items():
            runs[name].append(build_once(programs, options, knows_defects(programs)))

    result = {
        "machine": machine(),
        "compiler": first_line(["c++", "--version"]),
        "commit": first_line(["git", "-C", SOURCE, "describe", "--always", "--dirty", "--abbrev=12"]),
        "note": options.note,
        "threads": options.threads,
        "repetitions": options.repetitions,
    }
    for name, all_runs in runs.items():
        result[name] = {"median_seconds": medians(all_runs), "peak_bytes": max(r["peak_bytes"] for r in all_runs),
                        "quality": all_runs[0]["quality"]}
    if options.baseline:
        result["ratio"] = ratios(runs["ours"], runs["baseline"])
    for stage, seconds in result["ours"]["median_seconds"].items():
        older = result["baseline"]["median_seconds"].get(stage) if options.baseline else None
        print(f"{stage:44} {seconds:7.2f} s" + (f"   {older:7.2f} s before" if older is not None else ""))
    if options.json:
        options.json.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
