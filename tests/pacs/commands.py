#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Each command of tissueform-pacs by hand, against programs that nobody here wrote: Orthanc, and DCMTK's dcmqrscp and movescu.

  commands.py PROGRAMS FOLDER

Fetches a study by C-GET, C-MOVE and WADO-RS, looks at what came, builds, publishes and stores it, and reports where everything is;
then the same study goes through dcmqrscp, by our C-STORE, C-GET and C-MOVE, and by movescu to `listen`. Prints a line for each
check; exit code 1 when one fails, 77 when a program of others is missing.
"""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent.parent / "deploy" / "pacs"))
sys.dont_write_bytecode = True

import stack
from free_ports import free_ports

try:
    import head_series
    import pydicom
except ImportError as missing_module:
    print(f"skipped: {missing_module}")
    sys.exit(77)

RECIPE = pathlib.Path(__file__).resolve().parent / "recipe.json"
PATIENT = {"name": "Planted^Patricia", "patient_id": "PLANTED-4711", "born": "19610203"}
SLICES, OBJECTS = 93, 6
STRANGER = "STRANGER"
BUILD_S = 240

failures = []


def check(what, good, more=""):
    print(f"{'ok  ' if good else 'FAIL'} {what}{f': {more}' if more and not good else ''}", flush=True)
    if not good:
        failures.append(what)


class Bridge:
    """The commands on one folder of state."""

    def __init__(self, programs, state, options):
        self.program, self.state, self.options = programs.programs / "tissueform-pacs", programs.folder / state, options

    def run(self, *words):
        command = [self.program, *words, *self.options, "--state-dir", self.state]
        # What is stored has pictures: Mesa leaks under AddressSanitizer (tests/core/planning/rendering/figure_test.cc).
        environment = os.environ | ({"LSAN_OPTIONS": "detect_leaks=0"} if words[0] == "store" else {})
        return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=BUILD_S, check=False, env=environment)

    def break_off(self, programs, *words):
        """Begins a command and ends it by SIGTERM once it has children: its exit code, and their pids."""
        command = [self.program, *words, *self.options, "--state-dir", self.state]
        with subprocess.Popen(list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            children = programs.wait_for("a child", lambda: stack.children_of(process.pid))
            process.terminate()
            return process.wait(stack.PATIENCE_S), children

    def status(self):
        return json.loads(self.run("status", "--json").stdout)

    def received(self):
        return {pydicom.dcmread(path).SOPInstanceUID: path for path in (self.state / "received").rglob("*") if path.is_file()}


def names_nobody(text):
    return not any(word in text for word in ("Planted", "Patricia", "PLANTED", "19610203", "1961"))


def data_set(path):
    """The bytes after the meta header."""
    data = pathlib.Path(path).read_bytes()
    length = int.from_bytes(data[140:144], "little")
    return data[144 + length:]


def check_fetched(way, bridge, study, ct_folder):
    fetched = bridge.run("fetch", study)
    check(f"fetch by {way}", fetched.returncode == 0 and f"{SLICES} objects, 0 failed" in fetched.stdout, fetched.stdout + fetched.stderr)
    check(f"what fetch by {way} prints names nobody", names_nobody(fetched.stdout + fetched.stderr))
    came = bridge.received()
    sent = {pydicom.dcmread(path).SOPInstanceUID: path for path in pathlib.Path(ct_folder).glob("*.dcm")}
    same = came.keys() == sent.keys() and all(data_set(came[uid]) == data_set(sent[uid]) for uid in sent)
    check(f"by {way} every slice comes to the last bit", same, f"{len(came)} of {len(sent)}")
    again = bridge.run("fetch", study)
    check(f"the same again by {way} is kept once", again.returncode == 0 and len(bridge.received()) == SLICES, again.stdout + again.stderr)
    states = [(series["state"], series["images"]) for series in bridge.status()["series"]]
    check(f"after {way} the series is chosen", states == [("chosen", SLICES)], str(states))


def check_series(bridge):
    listed = bridge.run("series")
    check("series says why one was chosen", listed.returncode == 0 and re.search(r"chosen.*93 axial slices", listed.stdout, re.DOTALL) is not None,
          listed.stdout + listed.stderr)
    check("series names nobody", names_nobody(listed.stdout))


def check_refused(what, end, words):
    line = end.stderr.strip()
    check(f"{what} is refused in one line", end.returncode == 1 and len(line.splitlines()) == 1 and words in line, f"{end.returncode} {line}")


def check_wrong_options(programs, options):
    """Wrong options are reported at the start, and not when the first head has come."""
    broken, at = programs.folder / "broken.json", options.index("--recipe") + 1
    broken.write_text('{"format": ')
    for what, recipe, words in (("a recipe that is a folder", programs.folder, "recipe"), ("a recipe that is no JSON", broken, "broken.json: not valid JSON at line 1")):
        check_refused(what, Bridge(programs, "wrong", [*options[:at], recipe, *options[at + 1:]]).run("run"), words)
    both = Bridge(programs, "wrong", [*options, "--pacs", "localhost:104"]).run("run")
    check("two PACS are refused in one line", both.returncode == 2 and len(both.stderr.splitlines()) == 1, both.stderr)


def check_way_to_the_server(programs, bridge):
    """From a fetched series to a case; its key."""
    key = bridge.status()["series"][0]["key"]
    check_refused("publishing what is not built", bridge.run("publish", key), "is chosen: build its case first")
    check_refused("building what is not there", bridge.run("build", "0" * 32), "no such series")
    end, children = bridge.break_off(programs, "build", key)
    programs.wait_for("the end of what builds the plan", lambda: not any(stack.runs(pid) for pid in children))
    check("SIGTERM breaks off a build", end == -signal.SIGTERM and bridge.status()["series"][0]["state"] == "chosen", str(end))
    built = bridge.run("build", key)
    check("build makes a plan and a case", built.returncode == 0 and "is packed: cases/" in built.stdout, built.stdout + built.stderr[-500:])
    published = bridge.run("publish", key)
    check("publish gives it to the server", published.returncode == 0 and "is published: cases/" in published.stdout, published.stderr)
    check("once more changes nothing", bridge.run("publish", key).stdout == published.stdout)
    return bridge.status()["series"][0]["case"]


def check_store(programs, bridge, case, count):
    """From a prediction to objects in the PACS, which `count` counts."""
    before = count()
    sent = programs.tissueform("prediction", "send", programs.predict(case))
    export = re.search(r"exports/[\w-]+", sent.stdout).group(0)
    check_refused("storing what nobody has asked for", bridge.run("store", "exports/unknown"), "unknown")
    shown = bridge.run("store", export)
    check("store shows whose it is", shown.returncode == 0 and "Planted" in shown.stdout and "PLANTED-4711" in shown.stdout, shown.stdout + shown.stderr)
    check("and stores nothing without a person's word", count() == before)
    stored = bridge.run("store", export, "--confirm-patient")
    check("store with a person's word", stored.returncode == 0 and f"{export} is told" in stored.stdout, stored.stdout + stored.stderr)
    check("every object is in the PACS", count() - before == OBJECTS, str(count() - before))
    bridge.run("store", export, "--confirm-patient")
    check("and once only", count() - before == OBJECTS, str(count() - before))
    table, exports = bridge.run("status").stdout, bridge.status()["exports"]
    check("status tells it", [found["state"] for found in exports if found["name"] == export] == ["told"] and export in table, table)
    check("status names nobody", names_nobody(table + json.dumps(exports)))


def check_merged(programs, bridge, case, study):
    """A patient who is merged into another one after a person has looked."""
    sent = programs.tissueform("prediction", "send", programs.predict(case, title="Before the merge"))
    export = re.search(r"exports/[\w-]+", sent.stdout).group(0)
    bridge.run("store", export)
    name, = programs.orthanc("/tools/find", {"Level": "Patient", "Query": {"PatientID": PATIENT["patient_id"]}})
    programs.orthanc(f"/patients/{name}/modify", {"Replace": {"PatientID": "MERGED-1"}, "Force": True, "KeepSource": False,
                                                 "Keep": ["StudyInstanceUID", "SeriesInstanceUID", "SOPInstanceUID"]})
    before = len(programs.instances_of(study))
    check_refused("storing what is another patient's by now", bridge.run("store", export, "--confirm-patient"), "another patient ID")
    state_of = {found["name"]: found["state"] for found in bridge.status()["exports"]}
    check("it waits for a person again, and nothing is stored", state_of[export] == "asked" and len(programs.instances_of(study)) == before, str(state_of))
    sent = programs.tissueform("prediction", "sent").stdout
    check("of which the server knows", re.search(rf"{export}.*data changed", sent) is not None, sent)
    shown = bridge.run("store", export)
    check("who sees the patient of now, and that it has changed", "MERGED-1" in shown.stdout and "another patient ID" in shown.stdout, shown.stdout)
    stored = bridge.run("store", export, "--confirm-patient")
    check("and stores it for that one", stored.returncode == 0 and len(programs.instances_of(study)) == before + OBJECTS, stored.stdout + stored.stderr)


def start_stranger(programs, port, bridge_port):
    """DCMTK's own archive."""
    area = programs.folder / "stranger"
    area.mkdir()
    settings = programs.folder / "dcmqrscp.cfg"
    settings.write_text(f"""NetworkTCPPort = {port}
MaxPDUSize = 16384
MaxAssociations = 16
HostTable BEGIN
bridge = ({stack.BRIDGE}, {stack.HOST}, {bridge_port})
HostTable END
VendorTable BEGIN
VendorTable END
AETable BEGIN
{STRANGER} {area} RW (100, 1024mb) ANY
AETable END
""")
    programs.start("stranger", ["dcmqrscp", "--config", settings])
    programs.wait_for("dcmqrscp", lambda: programs.listens(port), needs="stranger")
    return area


def check_stranger(programs, study, case_of):
    """The same with DCMTK's archive in the PACS's place; plain, on loopback."""
    port, bridge_port = free_ports(2)
    area = start_stranger(programs, port, bridge_port)
    subprocess.run(["storescu", "--call", STRANGER, "--scan-directories", stack.HOST, str(port), programs.folder / "ct"], check=True,
                   capture_output=True, timeout=stack.PATIENCE_S, env=stack.QUICK)
    receiving = ["--ae-title", stack.BRIDGE, "--listen", f"{stack.HOST}:{bridge_port}", "--allow-ae", STRANGER, "--allow-from", stack.HOST]
    common = [*receiving, "--pacs", f"{stack.HOST}:{port}", "--pacs-ae-title", STRANGER, "--recipe", RECIPE, *case_of.server_options]
    for fetch in ("get", "move"):
        check_fetched(f"C-{fetch.upper()} of dcmqrscp", Bridge(programs, f"stranger-{fetch}", [*common, "--pacs-fetch", fetch]), study, programs.folder / "ct")

    # What the case was made from goes on with another PACS, by C-STORE.
    bridge = Bridge(programs, "bridge", [*common, "--pacs-fetch", "get"])
    check_store(programs, bridge, case_of.case, lambda: len([path for path in area.glob("*") if path.name != "index.dat"]))

    listening = Bridge(programs, "stranger-listen", receiving)
    programs.start("listen", [listening.program, "listen", *receiving, "--quiet-seconds", "1", "--state-dir", listening.state])
    programs.wait_for("listen", lambda: programs.listens(bridge_port), needs="listen")
    moved = subprocess.run(["movescu", "--study", "--aetitle", "SCANNER", "--call", STRANGER, "--move", stack.BRIDGE, "--key", "QueryRetrieveLevel=SERIES",
                            "--key", f"StudyInstanceUID={study}", "--key", f"SeriesInstanceUID={case_of.series}", stack.HOST, str(port)],
                           capture_output=True, text=True, timeout=stack.PATIENCE_S, check=False, env=stack.QUICK)
    programs.wait_for("the series in the queue", lambda: [series["images"] for series in listening.status()["series"]] == [SLICES], needs="listen")
    check("movescu sends the series to `listen`", moved.returncode == 0, moved.stderr)
    programs.wait_for("the end of the series", lambda: listening.status()["series"][0]["state"] == "complete", needs="listen")
    programs.stop("listen")
    check("which chooses nothing without rules", listening.status()["series"][0]["state"] == "complete")


class Made:
    """What was made of the study, for who goes on with it."""

    def __init__(self, case, series, server_options):
        self.case, self.series, self.server_options = case, series, server_options


def run(programs):
    programs.start_orthanc()
    programs.start_server()
    study, series = head_series.write_series(programs.folder / "ct", **PATIENT)
    sent = programs.store_from_scanner(programs.folder / "ct")
    check("storescu gives the head to Orthanc", sent.returncode == 0, sent.stderr)
    web, associations = [], []
    for by_web, options in ((True, web), (False, associations)):
        programs.by_web = by_web
        options += programs.bridge_options()[2:]
    check_wrong_options(programs, web)
    bridge = Bridge(programs, "bridge", web)
    ways = {"C-GET": Bridge(programs, "get", associations), "C-MOVE": Bridge(programs, "move", [*associations, "--pacs-fetch", "move"]), "WADO-RS": bridge}
    for way, by_way in ways.items():
        check_fetched(way, by_way, study, programs.folder / "ct")
        check_refused(f"a study that the PACS has not, by {way}", by_way.run("fetch", "1.2.3"), "no such study")
    by_number = Bridge(programs, "accession", associations).run("fetch", "--accession", "A1")
    check("fetch by the accession number", by_number.returncode == 0 and f"{SLICES} objects, 0 failed" in by_number.stdout, by_number.stdout + by_number.stderr)
    check_series(bridge)
    case = check_way_to_the_server(programs, bridge)
    check_store(programs, bridge, case, lambda: len(programs.instances_of(study)))
    certificate, key = programs.identities["bridge"]
    server = ["--server", f"localhost:{programs.server_port}", "--server-ca", programs.authority.certificate, "--server-cert", certificate,
              "--server-key", key, "--accept-defects"]
    check_stranger(programs, study, Made(case, series, server))
    check_merged(programs, bridge, case, study)


def main():
    missing = stack.missing_programs() + [name for name in ("dcmqrscp", "movescu") if shutil.which(name) is None]
    if missing:
        print(f"skipped: not installed: {', '.join(missing)}")
        sys.exit(77)
    programs, folder = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    with stack.Stack(programs, folder, RECIPE, quiet_s=1) as running:
        run(running)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
