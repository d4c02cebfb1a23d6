#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""From a PACS that nobody here wrote and back: Orthanc, tissueform-pacs, tissueform-server.

  roundtrip.py PROGRAMS FOLDER [associations]     without the last word the bridge speaks DICOMweb

A head goes to Orthanc by storescu, to the bridge, becomes a case; predictions go back into the patient's study. Checks what came
back by dciodvfy, pydicom, dcmj2pnm and GDCM; looks for the patient's name where it must not be; kills each program at each step;
tries peers that must be refused. Prints a line for each; exit code 1 when one fails, 77 when a program of others is missing.
"""

import concurrent.futures
import io
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent.parent / "deploy" / "pacs"))
sys.dont_write_bytecode = True

import stack

try:
    import head_series
    import pydicom
except ImportError as missing_module:
    print(f"skipped: {missing_module}")
    sys.exit(77)

HERE = pathlib.Path(__file__).resolve().parent
# That of deploy/pacs with a coarser mesh, for which all goes faster.
RECIPE = HERE / "recipe.json"
BUILD_S = 240
# Four models (skin before and predicted, one segment, fixed bone), the capture, the report.
OBJECTS = 6
STL = "1.2.840.10008.5.1.4.1.1.104.3"
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
    told = programs.tissueform("prediction", "send", prediction)
    return re.search(r"exports/[\w-]+", told.stdout).group(0)


def confirm(programs, export, looks=False):
    """The person's word; who looks waits for the pictures."""
    def form():
        if looks and "<img" not in programs.worklist():
            return None
        return next((fields for fields in programs.forms() if fields.get("export") == export), None)
    return programs.confirm(programs.wait_for(f"the question for {export}", form, needs="bridge"))


def wait_until_stored(programs, export):
    def stored():
        lines = [line for line in programs.tissueform("prediction", "sent").stdout.splitlines() if line.startswith(export)]
        if lines and " failed " in lines[0]:
            raise SystemExit(f"{lines[0]}\n{programs.log('bridge').read_text()[-2000:]}")
        return lines and " stored " in lines[0]
    programs.wait_for(f"{export} in the PACS", stored)


def objects_of(programs, study):
    """What is no CT image, by Orthanc's name: bytes, tags as Orthanc knows them, and as pydicom reads them."""
    found = {}
    for instance in programs.instances_of(study):
        tags = programs.orthanc(f"/instances/{instance}/simplified-tags")
        if tags["Modality"] == "CT":
            continue
        data = programs.orthanc_file(instance)
        found[instance] = (data, tags, pydicom.dcmread(io.BytesIO(data)))
    return found


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
                    if item.SOPClassUID == STL:
                        self.models[item.SOPInstanceUID] = bytes(item.EncapsulatedDocument)
                    self.seen.add(path)
                except (OSError, AttributeError, pydicom.errors.InvalidDicomError):
                    continue  # on its way, or gone

    def end(self):
        self.ended.set()
        self.join()
        return self.models


def errors_of(path):
    run = subprocess.run(["dciodvfy", path], capture_output=True, text=True, timeout=stack.PATIENCE_S, check=False)
    return [line for line in (run.stdout + run.stderr).splitlines() if line.startswith("Error")]


def terms(item):
    """What the report names, with its numbers."""
    for child in item.get("ContentSequence", []):
        name = child.get("ConceptNameCodeSequence")
        number = child.get("MeasuredValueSequence")
        yield (name[0].CodeValue if name else "", number[0] if number else None)
        yield from terms(child)


def check_report(report):
    found = list(terms(report))
    names = {name for name, _ in found}
    check("the report tells poses, movements of places and their band", {"MOVEMENT", "BAND"} <= names, str(sorted(names)))
    bands = [float(number.NumericValue) for name, number in found if name == "BAND"]
    check("a band is some of a movement and none is zero", bands and all(0 < band < 20 for band in bands), str(bands))
    check("its numbers are mm, degrees or counts by UCUM",
          all(number.MeasurementUnitsCodeSequence[0].CodingSchemeDesignator == "UCUM" for _, number in found if number is not None))


def check_models(objects, original, written):
    models = [item for _, _, item in objects.values() if item.SOPClassUID == STL]
    check("there are models of skin and bone", len(models) >= 3, str(len(models)))
    check("units are mm", all(model.MeasurementUnitsCodeSequence[0].CodeValue == "mm" for model in models))
    check("models lie in the CT's frame of reference", all(model.FrameOfReferenceUID == original.FrameOfReferenceUID for model in models))
    back = {model.SOPInstanceUID: bytes(model.EncapsulatedDocument) for model in models}
    check("STL comes back byte for byte", len(back) > 0 and written == back, f"{len(written)} written, {len(back)} back")
    for model in models:
        length = model.EncapsulatedDocumentLength
        stl = bytes(model.EncapsulatedDocument)[:length]
        count = int.from_bytes(stl[80:84], "little")
        check(f"{model.DocumentTitle} is a binary STL", len(stl) == 84 + 50 * count and count > 100, f"{len(stl)} bytes, {count} triangles")


def check_capture(programs, path, frames):
    folder = programs.folder / "frames"
    folder.mkdir(exist_ok=True)
    subprocess.run(["dcmj2pnm", "--write-png", "--all-frames", path, folder / "frame"], capture_output=True, timeout=stack.PATIENCE_S, check=False)
    check("dcmj2pnm reads all frames of the capture", len(list(folder.glob("frame*"))) == frames, str(frames))
    if shutil.which("gdcmraw"):
        raw = programs.folder / "frames.raw"
        run = subprocess.run(["gdcmconv", "--raw", path, programs.folder / "frames.dcm"], capture_output=True, timeout=stack.PATIENCE_S, check=False)
        same = run.returncode == 0 and pydicom.dcmread(programs.folder / "frames.dcm").NumberOfFrames == frames
        check("GDCM reads all frames of the capture", same, str(raw))


def check_objects(programs, study, ct_folder, written):
    original = pydicom.dcmread(next(pathlib.Path(ct_folder).glob("*.dcm")))
    objects = objects_of(programs, study)
    folder = programs.folder / "back"
    folder.mkdir(exist_ok=True)
    for instance, (data, tags, item) in objects.items():
        path = folder / f"{instance}.dcm"
        path.write_bytes(data)
        found = errors_of(path)
        check(f"dciodvfy finds no error in the {tags['Modality']}", not found, "; ".join(found[:4]))
        same = all(tags.get(name, "") == str(item.get(name, "")) for name in ("SOPInstanceUID", "SeriesInstanceUID", "StudyInstanceUID", "SOPClassUID"))
        check(f"Orthanc and pydicom agree on the UIDs of the {tags['Modality']}", same)
        copied = ("PatientName", "PatientID", "PatientBirthDate", "StudyInstanceUID", "StudyID", "StudyDate", "AccessionNumber")
        check(f"patient and study of the {tags['Modality']} are the CT's", all(item.get(name) == original.get(name) for name in copied))
        if "NumberOfFrames" in item and item.Modality != "CT":
            check_capture(programs, path, int(item.NumberOfFrames))
    for _, _, item in objects.values():
        if item.Modality == "SR":
            check_report(item)
    kinds = {tags["Modality"] for _, tags, _ in objects.values()}
    check("there are models, a capture and a report", {"M3D", "SR"} <= kinds and len(kinds) >= 3, str(kinds))
    check_models(objects, original, written)


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


def kill(programs, victim):
    """As the power switch would, and on again."""
    programs.stop(victim, signal.SIGKILL)
    {"orthanc": programs.start_orthanc, "server": programs.start_server, "bridge": programs.start_bridge}[victim]()


def check_end_while_building(programs):
    """SIGTERM while a plan is built: the bridge ends, and so do its children, if later by what it takes them to see that."""
    bridge = programs.running["bridge"]
    building = programs.wait_for("a plan that is built", lambda: stack.children_of(bridge.pid), needs="bridge")
    programs.stop("bridge")
    check("SIGTERM while a plan is built ends the bridge with exit code 0", bridge.returncode == 0, str(bridge.returncode))
    programs.wait_for("the end of what builds the plan", lambda: not any(stack.runs(pid) for pid in building))
    programs.start_bridge()


def check_kills_while_building(programs, count):
    """Two series are on their way while each program goes."""
    check_end_while_building(programs)
    points = 0
    for victim in ("bridge", "server", "orthanc", "bridge"):
        kill(programs, victim)
        points += 1
    published = wait_for_cases(programs, count)
    check(f"{points} kills while plans are built: {count} cases", len(published) == count == len(set(programs.cases())), str(published))
    return points


def check_kills_while_storing(programs, prediction, study):
    """At each step of an export the bridge is killed, then the server, then the PACS; afterwards every object is there once."""
    steps = ("asked", "confirmed", "fetched", "written", "sent", "told")
    victims = ("bridge", "server", "orthanc")
    before = len(objects_of(programs, study))
    of_one = None
    for number, step in enumerate(steps):
        export = send(programs, prediction)
        programs.wait_for("the export in the queue", lambda name=export: name in export_states(programs), needs="bridge")
        if step != "asked":
            confirm(programs, export)
            programs.wait_for(step, lambda name=export, reached=steps[number:]: export_states(programs).get(name) in reached, needs="bridge")
        for victim in victims:
            kill(programs, victim)
        if step == "asked":
            confirm(programs, export)
        wait_until_stored(programs, export)
        after = len(objects_of(programs, study))
        of_one = of_one or after - before
        check(f"bridge, server and PACS killed when an export is {step}: each object once", after - before == of_one == OBJECTS,
              f"{after - before} of {of_one}")
        before = after
    return len(steps) * len(victims)


def run(programs):
    began = time.monotonic()
    programs.start_orthanc()
    programs.start_server()
    programs.start_bridge()
    study, _ = head_series.write_series(programs.folder / "ct", **PLANTED)
    sent = programs.store_from_scanner(programs.folder / "ct")
    check("storescu gives the head to Orthanc", sent.returncode == 0 and len(programs.instances_of(study)) == 93, sent.stderr)
    last_slice = time.monotonic()
    programs.send_to_bridge(study)
    case = next(iter(wait_for_cases(programs, 1).values()))
    print(f"     last slice to published case: {time.monotonic() - last_slice:.1f} s")
    prediction = programs.predict(case)
    export = send(programs, prediction)
    written = Written(programs.folder / "bridge" / "objects")
    confirm(programs, export, looks=True)
    confirmed = time.monotonic()
    wait_until_stored(programs, export)
    print(f"     word to stored: {time.monotonic() - confirmed:.1f} s")
    check_objects(programs, study, programs.folder / "ct", written.end())
    check_refusals(programs)

    # A second study of the patient and another patient, at once.
    others = [(programs.folder / "ct2", PLANTED), (programs.folder / "ct3", OTHER)]
    with concurrent.futures.ThreadPoolExecutor() as pool:
        studies = [made[0] for made in pool.map(lambda of: head_series.write_series(of[0], number=2, **of[1]), others)]
        list(pool.map(lambda of: programs.store_from_scanner(of[0]), others))
        list(pool.map(programs.send_to_bridge, studies))
    points = check_kills_while_building(programs, 3)
    points += check_kills_while_storing(programs, prediction, study)
    print(f"     {points} kills")
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
