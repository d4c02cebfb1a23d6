#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""`tissueform-pacs fetch` of a study with a scout, a sharp and a soft series, from Orthanc: which one is chosen, and what is said
when the PACS has lost an image.

  fetch.py PROGRAMS FOLDER

Prints a line for each check; exit code 1 when one fails, 77 when a program of others is missing.
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent.parent / "deploy" / "pacs"))
sys.dont_write_bytecode = True

import stack

try:
    import head_series
except ImportError as missing_module:
    print(f"skipped: {missing_module}")
    sys.exit(77)

RECIPE = pathlib.Path(__file__).resolve().parent / "recipe.json"

failures = []


def check(what, good, more=""):
    print(f"{'ok  ' if good else 'FAIL'} {what}{f': {more}' if more and not good else ''}", flush=True)
    if not good:
        failures.append(what)


def make_scout(image, _):
    image.ImageType, image.SeriesNumber = ["ORIGINAL", "PRIMARY", "LOCALIZER"], "1"


def make_sharp(image, _):
    image.ConvolutionKernel, image.SeriesNumber = "H60s", "2"


def make_soft(image, _):
    image.ConvolutionKernel, image.SeriesNumber = "H30s", "3"


def fetch(programs, study, state):
    """How `fetch` ends with a folder of state of its own, and what `status` says of each kernel or kind of series then."""
    folder = programs.folder / state
    options = programs.bridge_options()[2:]
    command = [programs.bridge_program, "fetch", study, *options, "--state-dir", folder]
    end = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=stack.PATIENCE_S, check=False)
    status = subprocess.run([programs.bridge_program, "status", "--json", "--state-dir", folder], capture_output=True, text=True,
                          timeout=stack.PATIENCE_S, check=True)
    return end, [(series["state"], series["images"], series["reason"]) for series in json.loads(status.stdout)["series"]]


def states(found):
    return sorted(state for state, _, _ in found)


def lose_an_image(programs, series):
    """Takes the file of one image out of Orthanc's store, and Orthanc anew, which keeps images in memory, too."""
    instance = programs.orthanc("/tools/find", {"Level": "Instance", "Query": {"SeriesInstanceUID": series}})[0]
    lost = programs.orthanc_file(instance)
    programs.stop("orthanc")
    for path in (programs.folder / "orthanc").rglob("*"):
        if path.is_file() and path.stat().st_size == len(lost) and path.read_bytes() == lost:
            path.unlink()
    programs.start_orthanc()


def run(programs):
    programs.start_orthanc()
    study, _ = head_series.write_series(programs.folder / "scout", alter=make_scout)
    head_series.write_series(programs.folder / "sharp", study=study, alter=make_sharp)
    _, soft = head_series.write_series(programs.folder / "soft", study=study, alter=make_soft)
    for name in ("scout", "sharp", "soft"):
        sent = programs.store_from_scanner(programs.folder / name)
        check(f"Orthanc takes the {name} series", sent.returncode == 0, sent.stderr)

    end, found = fetch(programs, study, "whole")
    check("fetch of the whole study", end.returncode == 0, end.stdout + end.stderr)
    check("one of three series is chosen", states(found) == ["chosen", "passed_over", "passed_over"], str(found))
    reasons = {state: [reason for of, _, reason in found if of == state] for state in states(found)}
    check("the soft one", "soft kernel" in reasons["chosen"][0], str(found))
    check("and the reasons say why not the others",
          any("softer kernel" in reason for reason in reasons["passed_over"]) and any("localizer" in reason for reason in reasons["passed_over"]), str(found))

    lose_an_image(programs, soft)
    end, found = fetch(programs, study, "part")
    line = end.stderr.strip()
    check("a study of which an image does not come ends with exit code 1 and one line",
          end.returncode == 1 and re.fullmatch(r"tissueform-pacs: [1-9]\d* objects of the study did not arrive;.*", line) is not None, line)
    check("what came is there, and what lacks an image is not chosen", states(found) == ["chosen", "incomplete", "passed_over"], str(found))
    check("but the sharp one", any(state == "chosen" and "sharp kernel" in reason for state, _, reason in found), str(found))


def main():
    missing = stack.missing_programs()
    if missing:
        print(f"skipped: not installed: {', '.join(missing)}")
        sys.exit(77)
    programs, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    with stack.Stack(programs, folder, RECIPE, quiet_s=1, by_web=False) as running:
        run(running)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
