#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""From the PACS and back on this machine: what deploy/pacs/demo.sh does once everything is built.

Orthanc, the server, the gateway and the bridge start on loopback, with TLS between them. A scanner sends the bundled head to
Orthanc, Orthanc sends it on to the bridge, which makes a case of it; a prediction goes back into the patient's study and is
listed by DICOMweb. docs/pacs.md tells what there is to see. Research software, not a medical device.
"""

import argparse
import collections
import json
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import head_series
import stack
from folders import make_folder

HERE = pathlib.Path(__file__).resolve().parent


def curl(programs, path):
    """What anybody's DICOMweb client sees."""
    certificate, key = programs.identities["scanner"]
    command = ["curl", "--silent", "--show-error", "--noproxy", "*", "--cacert", programs.authority.certificate, "--cert", certificate,
               "--key", key, "--header", "Accept: application/dicom+json", programs.dicomweb + path]
    print("  $", " ".join(map(str, command)))
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=stack.PATIENCE_S, check=True).stdout


def value_of(item, tag):
    return str((item.get(tag, {}).get("Value") or [""])[0])


def verified(programs, study):
    """Stores what came back; returns what dciodvfy says of it."""
    folder = programs.folder / "back"
    folder.mkdir(exist_ok=True)
    for number, instance in enumerate(programs.instances_of(study)):
        tags = programs.orthanc(f"/instances/{instance}/simplified-tags")
        if tags["Modality"] == "CT":
            continue
        path = folder / f"{tags['Modality']}-{number}.dcm"
        path.write_bytes(programs.orthanc_file(instance))
        checked = subprocess.run(["dciodvfy", path], capture_output=True, text=True, timeout=stack.PATIENCE_S, check=False)
        lines = (checked.stdout + checked.stderr).splitlines()
        errors = [line for line in lines if line.startswith("Error")]
        print(f"  {tags['Modality']:3} {tags.get('DocumentTitle') or tags.get('SeriesDescription', '')}: {len(errors)} errors")
        for line, count in collections.Counter(lines).items():
            print("      ", line[:160], f"({count} times)" if count > 1 else "")
    return folder


def captured(programs, folder):
    """The first frame of the capture as a picture."""
    capture = next(folder.glob("OT-*.dcm"))
    picture = programs.folder / "capture.png"
    subprocess.run(["dcmj2pnm", "--write-png", "--frame", "1", capture, picture], check=True, capture_output=True, timeout=stack.PATIENCE_S)
    print(f"  first frame of the capture: {picture}")


def screenshot(programs, name):
    """The review page as a browser shows it, where one is installed."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        return
    picture = programs.folder / name
    command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1200,1000",
               f"--user-data-dir={programs.folder / 'browser'}", f"--screenshot={picture}", f"http://{stack.HOST}:{programs.review_port}/"]
    shot = subprocess.run(command, capture_output=True, timeout=stack.PATIENCE_S, check=False)
    print(f"  the review page: {picture}" if shot.returncode == 0 and picture.exists() else "  the browser has made no picture of the review page")


def run(programs, web):
    began = time.monotonic()

    def report(text):
        print(f"[{time.monotonic() - began:5.1f} s] {text}", flush=True)

    programs.start_orthanc()
    programs.start_server()
    programs.start_gateway(web)
    programs.start_bridge()
    report("Orthanc, server, gateway and bridge run on loopback, TLS between them")
    study, _ = head_series.write_series(programs.folder / "ct")
    sent = programs.store_from_scanner(programs.folder / "ct")
    if sent.returncode != 0:
        raise SystemExit(f"storescu: {sent.stderr}")
    report(f"storescu has sent {len(programs.instances_of(study))} slices to Orthanc")
    programs.send_to_bridge(study)
    report("Orthanc has sent them to the bridge, which builds the plan")
    case = programs.wait_for("the case", lambda: (programs.cases() or [None])[0], patience_s=300, needs="bridge")
    report(f"published: {case}")
    prediction = programs.predict(case)
    report(f"a planner stores {prediction} and sends it to the PACS")
    programs.tissueform("prediction", "send", prediction)
    form = programs.wait_for("the review page's question, with pictures",
                             lambda: "<img" in programs.review() and (programs.forms() or [None])[0], needs="bridge")
    report("the review page shows the patient, with pictures, and asks")
    screenshot(programs, "review.png")
    programs.confirm(form)
    report("confirmed in the review page")
    programs.wait_for("the objects", lambda: ": stored" in programs.tissueform("prediction", "send", prediction).stdout
                      or " stored " in programs.tissueform("prediction", "sent").stdout, needs="bridge")
    report("stored; QIDO-RS lists the study's series:")
    for series in json.loads(curl(programs, f"/studies/{study}/series")):
        print(f"  {value_of(series, '00080060'):3} {value_of(series, '0008103E'):58} {value_of(series, '0020000E')}")
    report("the objects, as Orthanc has them, and what dciodvfy says of each:")
    captured(programs, verified(programs, study))


def end_once(*_):
    """For SIGTERM, which timeout(1) sends twice: the second one must not end the ending."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit(128 + signal.SIGTERM)


def main():
    parser = argparse.ArgumentParser(prog="deploy/pacs/demo.sh", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--web", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--serve", action="store_true", help="keep all of it running until Ctrl-C; the last lines say where review page and planner are")
    parser.add_argument("--folder", metavar="DIR", help="where logs, pictures, objects and the keys of this one time go (default: a new temporary folder)")
    words = parser.parse_args()
    missing = stack.missing_programs()
    if missing:
        sys.exit(f"missing: {', '.join(missing)}; deploy/install_packages.sh test installs them")
    # However this program ends, it ends what it has started: also by SIGTERM, and where a shell makes it ignore Ctrl-C.
    signal.signal(signal.SIGTERM, end_once)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    folder = pathlib.Path(words.folder or tempfile.mkdtemp(prefix="tissueform-pacs-"))
    make_folder(folder, "--folder")
    with stack.Stack(pathlib.Path(words.programs).resolve(), folder.resolve(), HERE / "recipe.json") as programs:
        run(programs, pathlib.Path(words.web).resolve())
        print(f"everything lies in {folder}; delete it when you have looked")
        if not words.serve:
            print("the programs end now; with --serve they keep running")
            return
        print(f"review page http://{stack.HOST}:{programs.review_port}/\nplanner   http://localhost:{programs.gateway_port}/\nCtrl-C ends it", flush=True)
        try:
            while all(process.poll() is None for process in programs.running.values()):
                time.sleep(1)
        except KeyboardInterrupt:
            pass


if __name__ == "__main__":
    main()
