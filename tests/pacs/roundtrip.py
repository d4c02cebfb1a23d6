#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""From a PACS that nobody here wrote and back: Orthanc, tissueform-pacs, tissueform-server.

  roundtrip.py PROGRAMS FOLDER [associations]     without the last word the bridge speaks DICOMweb

A head goes to Orthanc by storescu, to the bridge, becomes a case; predictions go back into the patient's study. Checks what came
back (returned_objects.py); looks for the patient's name where it must not be; kills each program at each step (halts.py); tries
peers and series that must be refused. Prints a line for each; exit code 1 when one fails, 77 when a program of others is missing.
"""

import concurrent.futures
import datetime
import os
import pathlib
import re
import shutil
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent.parent / "deploy" / "pacs"))
sys.dont_write_bytecode = True

import stack

try:
    import bad_input
    import head_series
    import pydicom
    import returned_objects
    from halts import BRIDGE, EXPORT_POINTS, OTHERS, PLAN_POINTS, Halts
    from returned_objects import objects_of, terms
except ImportError as missing_module:
    print(f"skipped: {missing_module}")
    sys.exit(77)

HERE = pathlib.Path(__file__).resolve().parent
# That of deploy/pacs with a coarser mesh, for which all goes faster.
RECIPE = HERE / "recipe.json"
BUILD_S = 240
# Four models (skin before and predicted, one segment, fixed bone), the capture, the report.
OBJECTS = 6
# What the bridge may have resident.
MOST_MIB = 200
# A sanitizer's own memory hides the program's.
IS_SANITIZED = any(name.endswith("SAN_OPTIONS") for name in os.environ)
PLANTED = {"name": "Planted^Patricia", "patient_id": "PLANTED-4711", "born": "19610203"}
OTHER = {"name": "Another^Anton", "patient_id": "OTHER-0815", "born": "19550607"}
WORDS = [b"Planted", b"Patricia", b"PLANTED-4711", b"19610203", b"Another^Anton", b"OTHER-0815", b"19550607"]

failures = []


def check(what, good, more=""):
    print(f"{'ok  ' if good else 'FAIL'} {what}{f': {more}' if more and not good else ''}", flush=True)
    if not good:
        failures.append(what)


def published_cases(programs):
    return {entry["key"]: entry["case"] for entry in programs.bridge_status().get("series", []) if entry["state"] == "published"}


def export_states(programs):
    return {entry["name"]: entry["state"] for entry in programs.bridge_status().get("exports", [])}


def wait_for_cases(programs, count):
    return programs.wait_for(f"{count} cases", lambda: (published := published_cases(programs)) and len(published) >= count and published,
                             patience_s=BUILD_S, needs="bridge")


def send(programs, prediction):
    """Somebody wants it in the PACS, once more where it is there already: the export's name."""
    sent = programs.tissueform("prediction", "send", prediction)
    return re.search(r"exports/[\w-]+", sent.stdout).group(0)


def confirm(programs, export, looks=False):
    """The person's word; who looks waits for the pictures."""
    def form():
        try:
            if looks and "<img" not in programs.review():
                return None
            return next((fields for fields in programs.forms() if fields.get("export") == export), None)
        except OSError:
            return None  # the bridge has only just begun
    return programs.confirm(programs.wait_for(f"the question for {export}", form, needs="bridge"))


def wait_until_stored(programs, export):
    def stored():
        lines = [line for line in programs.tissueform("prediction", "sent").stdout.splitlines() if line.startswith(export)]
        if lines and " failed " in lines[0]:
            raise SystemExit(f"{lines[0]}\n{programs.log('bridge').read_text()[-2000:]}")
        return lines and " stored " in lines[0]
    programs.wait_for(f"{export} in the PACS", stored)


class Written(threading.Thread):
    """What the bridge writes for the PACS, caught before it is sent and deleted: the models' bytes by their UIDs."""

    def __init__(self, folder):
        super().__init__(daemon=True)
        self.folder, self.models, self.seen, self.ended = folder, {}, set(), threading.Event()
        self.start()

    def run(self):
        while not self.ended.wait(0.02):
            try:
                new = [path for path in self.folder.rglob("*.dcm") if path not in self.seen]
            except FileNotFoundError:
                continue  # a folder went while it was looked into
            for path in new:
                try:
                    item = pydicom.dcmread(path)
                    if item.SOPClassUID == returned_objects.STL:
                        self.models[item.SOPInstanceUID] = bytes(item.EncapsulatedDocument)
                    self.seen.add(path)
                except (OSError, AttributeError, pydicom.errors.InvalidDicomError):
                    continue  # on its way, or gone

    def end(self):
        self.ended.set()
        self.join()
        return self.models


def moment_of(programs, pattern):
    """When the bridge's log says this for the first time, in seconds."""
    found = re.search(r"^\[([\d-]+ [\d:.]+)\].*" + pattern, programs.log("bridge").read_text(), re.MULTILINE)
    if found is None:
        raise SystemExit(f"the bridge's log has no line of {pattern!r}")
    return datetime.datetime.fromisoformat(found.group(1)).timestamp()


def print_times(programs):
    """What the bridge adds to `plan build`."""
    ended, chosen, built, published = (moment_of(programs, pattern) for pattern in (
        r"association \d+ ended: 93 objects", "is chosen", "chosen -> built", "packed -> published"))
    print(f"     last slice to published case: {published - ended:.1f} s, of which plan build {built - chosen:.1f} s; "
          f"beyond it {published - built + chosen - ended:.1f} s", flush=True)


def check_secrets(programs):
    """Only the bridge's own queue, what it received and what it writes for the PACS may name the patient."""
    places = [programs.folder / "server", programs.folder / "bridge" / "plans", *programs.folder.glob("*.log"), programs.folder / "exported"]
    hits, files = [], 0
    for place in places:
        for path in [place] if place.is_file() else place.rglob("*"):
            if not path.is_file():
                continue
            data, files = path.read_bytes(), files + 1
            hits += [f"{path}: {word.decode()}" for word in WORDS if word in data or word in path.name.encode()]
    check(f"no patient in {files} files of server, plans, logs and exports", not hits and files > 5, "; ".join(hits[:5]))


def export_files(programs):
    folder = programs.folder / "exported"
    folder.mkdir(exist_ok=True)
    listed = programs.tissueform("prediction", "list").stdout
    prediction = re.search(r"predictions/\w+", listed).group(0)
    (folder / "list.txt").write_text(listed + programs.tissueform("prediction", "sent").stdout)
    programs.tissueform("prediction", "export", prediction, "--out", folder / "prediction.json")
    programs.tissueform("prediction", "export", prediction, "--plan", next((programs.folder / "bridge").rglob("plan.json")), "--out", folder / "prediction.stl")
    programs.tissueform("prediction", "export", prediction, "--png", folder / "pictures")
    written = {path.suffix for path in folder.rglob("*") if path.is_file()}
    check("a prediction is exported as data, surface and pictures", {".txt", ".json", ".stl", ".png"} <= written, str(written))


def check_refusals(programs):
    image = next((programs.folder / "ct").glob("*.dcm"))
    certificate, key = programs.identities["scanner"]
    expired = programs.authority.issue("expired", days=-1)
    stranger = stack.Authority(programs.folder / "stranger", "Another authority").issue("stranger")
    authority = programs.authority.certificate

    def storescu(*words, calling=stack.ORTHANC):
        command = ["storescu", "--aetitle", calling, "--call", stack.BRIDGE, *words, stack.HOST, str(programs.bridge_dicom), image]
        return subprocess.run(list(map(str, command)), capture_output=True, timeout=stack.PATIENCE_S, check=False).returncode == 0

    check("the bridge takes a good peer", storescu("--enable-tls", key, certificate, "--add-cert-file", authority))
    check("the bridge refuses a plain peer", not storescu())
    check("the bridge refuses an anonymous peer", not storescu("--anonymous-tls", "--add-cert-file", authority))
    check("the bridge refuses an expired certificate", not storescu("--enable-tls", expired[1], expired[0], "--add-cert-file", authority))
    check("the bridge refuses another authority's certificate", not storescu("--enable-tls", stranger[1], stranger[0], "--add-cert-file", authority))
    check("the bridge refuses an AE title that it does not know",
          not storescu("--enable-tls", key, certificate, "--add-cert-file", authority, calling="NOBODY"))
    check("Orthanc refuses a plain peer", subprocess.run(["echoscu", "--call", stack.ORTHANC, stack.HOST, str(programs.orthanc_dicom)],
                                                         capture_output=True, timeout=stack.PATIENCE_S, check=False).returncode != 0)


def check_end_while_building(programs):
    """SIGTERM while a plan is built: the bridge ends, and so do its children, if later by what it takes them to see that."""
    bridge = programs.running["bridge"]
    building = programs.wait_for("a plan that is built", lambda: stack.children_of(bridge.pid), needs="bridge")
    programs.stop("bridge")
    check("SIGTERM while a plan is built ends the bridge with exit code 0", bridge.returncode == 0, str(bridge.returncode))
    programs.wait_for("the end of what builds the plan", lambda: not any(stack.runs(pid) for pid in building))
    programs.start_bridge(wait=False)


def check_kills_while_building(programs, halts, count):
    """Two series are on their way while each program goes."""
    halts.want(PLAN_POINTS[0])
    check_end_while_building(programs)
    deaths = list(zip(PLAN_POINTS, (BRIDGE, OTHERS, BRIDGE, OTHERS, BRIDGE)))
    for (point, victims), then in zip(deaths, [*PLAN_POINTS[1:], None]):
        halts.kill_at(point, victims, then)
    published = wait_for_cases(programs, count)
    check(f"kills while plans are built: {count} cases", len(published) == count == len(set(programs.cases())), str(published))


def check_kills_while_storing(programs, halts, prediction, study):
    """At each step of an export server and PACS die, and in another export the bridge; afterwards every object is there once."""
    before = len(objects_of(programs, study))
    for number, point in enumerate(EXPORT_POINTS):
        later = EXPORT_POINTS[(number + 1) % len(EXPORT_POINTS)]
        deaths = sorted([(point, OTHERS), (later, BRIDGE)], key=lambda death: EXPORT_POINTS.index(death[0]))
        halts.want(deaths[0][0])
        export, confirmed = send(programs, prediction), False
        for (place, victims), then in zip(deaths, (deaths[1][0], None)):
            if place != "export.asked" and not confirmed:
                confirmed = confirm(programs, export)
            halts.kill_at(place, victims, then)
        if not confirmed:
            confirm(programs, export)
        wait_until_stored(programs, export)
        after = len(objects_of(programs, study))
        check(f"server and PACS killed at {point}, the bridge at {later}: each object once", after - before == OBJECTS, f"{after - before} of {OBJECTS}")
        before = after


def check_deleted_study(programs, studies, case):
    """Somebody has deleted the study that a case is of."""
    for study in studies:
        for found in programs.orthanc("/tools/find", {"Level": "Study", "Query": {"StudyInstanceUID": study}}):
            programs.orthanc(f"/studies/{found}", method="DELETE")
    export = send(programs, programs.predict(case, title="Of a study that is gone", model="gradient_field"))
    confirm(programs, export)
    programs.wait_for("an export that has failed", lambda: export_states(programs).get(export) == "failed", needs="bridge")
    notes = [entry["note"] for entry in programs.bridge_status()["exports"] if entry["name"] == export]
    check("of a study that was deleted nothing is stored, and the bridge says so", len(notes) == 1 and "no longer has the series of this case" in notes[0], str(notes))

    def is_failed():
        lines = [line for line in programs.tissueform("prediction", "sent").stdout.splitlines() if line.startswith(export)]
        return lines and " failed " in lines[0]
    check("and whoever asked for it hears of it", programs.wait_for("the server hears of it", is_failed))
    check("the study does not come again", not any(programs.instances_of(study) for study in studies))


def run(programs):
    began = time.monotonic()
    programs.start_orthanc()
    programs.start_server()
    programs.start_bridge()
    study, _ = head_series.write_series(programs.folder / "ct", **PLANTED)
    sent = programs.store_from_scanner(programs.folder / "ct")
    check("storescu gives the head to Orthanc", sent.returncode == 0 and len(programs.instances_of(study)) == 93, sent.stderr)
    programs.send_to_bridge(study)
    case = next(iter(wait_for_cases(programs, 1).values()))
    print_times(programs)
    prediction = programs.predict(case)
    export = send(programs, prediction)
    written = Written(programs.folder / "bridge" / "objects")
    confirm(programs, export, looks=True)
    confirmed = time.monotonic()
    wait_until_stored(programs, export)
    print(f"     word to stored: {time.monotonic() - confirmed:.1f} s", flush=True)
    most_mib = stack.most_memory_mib(programs.running["bridge"].pid)
    print(f"     the bridge had at most {most_mib:.0f} MiB")
    if not IS_SANITIZED:
        check("the bridge keeps within its memory", most_mib < MOST_MIB, f"{most_mib:.0f} MiB")
    returned_objects.check_objects(check, programs, study, programs.folder / "ct", written.end())
    check_refusals(programs)

    # A second study of the patient and another patient, at once.
    others = [(programs.folder / "ct2", PLANTED), (programs.folder / "ct3", OTHER)]
    with concurrent.futures.ThreadPoolExecutor() as pool:
        studies = [made[0] for made in pool.map(lambda of: head_series.write_series(of[0], number=2, **of[1]), others)]
        list(pool.map(lambda of: programs.store_from_scanner(of[0]), others))
        list(pool.map(programs.send_to_bridge, studies))
    halts = Halts(programs)
    check_kills_while_building(programs, halts, 3)
    # Of a model without a band, for which a server that was killed has nothing to prepare.
    check_kills_while_storing(programs, halts, programs.predict(case, title="Often stored", model="gradient_field"), study)
    print(f"     {len(halts.kills)} kills: {', '.join(f'{victim} at {point}' for point, victim in halts.kills)}")
    wanted = {(point, victim) for point in EXPORT_POINTS for victim in BRIDGE + OTHERS}
    check("each program was killed at each step of an export", wanted <= set(halts.kills), str(wanted - set(halts.kills)))
    by_patient = {}
    for of_case in set(published_cases(programs).values()) - {case}:
        export = send(programs, programs.predict(of_case, model="gradient_field"))
        confirm(programs, export)
        wait_until_stored(programs, export)
    for of_study, patient in zip(studies, (PLANTED, OTHER)):
        objects = objects_of(programs, of_study)
        by_patient[of_study] = {str(item.PatientID) for _, _, item in objects.values()}
        check("what goes back goes into its own study", by_patient[of_study] == {patient["patient_id"]}, str(by_patient))
        names = {name for _, _, item in objects.values() if item.Modality == "SR" for name, _ in terms(item)}
        check("where no band is known the report tells movements without one", "MOVEMENT" in names and "BAND" not in names, str(sorted(names)))
        check("and says why", "NO_BAND" in names, str(sorted(names)))
    check_deleted_study(programs, studies, of_case)
    bad_input.check_bad_series(check, programs, **PLANTED)
    export_files(programs)
    check_secrets(programs)
    print(f"     {time.monotonic() - began:.0f} s")


def main():
    missing = stack.missing_programs()
    if missing:
        print(f"skipped: not installed: {', '.join(missing)}")
        sys.exit(77)
    programs, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    with stack.Stack(programs, folder, RECIPE, quiet_s=2, by_web=sys.argv[3:] != ["associations"]) as running:
        run(running)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
