#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The audit events of the real programs, read by programs that are not ours.

  audit_of_program.py collector SERVER TISSUEFORM    rsyslog receives them over TLS
  audit_of_program.py journal SERVER TISSUEFORM      systemd-journald keeps them, journalctl prints them
  audit_of_program.py bridge TISSUEFORM_PACS         storescu sends to the bridge, rsyslog receives its DICOM audit messages, and
                                                     xmllint checks them against the schema; strangers and users come to it

The journal's part runs in namespaces of its own, in which journald has an empty /run. Exit code 77: a program is missing, or
the machine allows no such namespaces.
"""

import base64
import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
PATIENCE_S = 60
JOURNALD = "/lib/systemd/systemd-journald"
SCHEMA = ROOT / "tests/client/pacs_bridge/audit/audit_message.rng"
OBJECT = """
(0008,0016) UI [1.2.840.10008.5.1.4.1.1.2]
(0008,0018) UI [1.2.3.3]
(0010,0010) PN [Planted^Patricia]
(0010,0020) LO [PLANTED-4711]
(0020,000d) UI [1.2.3.1]
(0020,000e) UI [1.2.3.2]
"""
TEMPLATE = """
template(name="events" type="list" option.jsonf="on") {
  property(outname="pri" name="pri" format="jsonf")
  property(outname="time" name="timereported" dateFormat="rfc3339" format="jsonf")
  property(outname="host" name="hostname" format="jsonf")
  property(outname="app" name="app-name" format="jsonf")
  property(outname="process" name="procid" format="jsonf")
  property(outname="id" name="msgid" format="jsonf")
  property(outname="data" name="structured-data" format="jsonf")
  property(outname="text" name="msg" format="jsonf")
}
"""


def check(condition, what, found=""):
    if not condition:
        raise SystemExit(f"WRONG: {what} {found}")
    print("right:", what, flush=True)


def wait_for(what, condition):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f"WRONG: {what}")
        time.sleep(0.02)
    print("right:", what, flush=True)


started = []


def start(*arguments, **options):
    started.append(subprocess.Popen(arguments, **options))
    return started[-1]


def end(process, number=signal.SIGTERM):
    process.send_signal(number)
    return process.wait(PATIENCE_S)


class Server:
    def __init__(self, programs, folder, *options):
        self.tissueform = programs[1]
        self.log = (folder / "server.log").open("ab")
        self.process = start(programs[0], "--port", "0", "--data-dir", folder / "data", "--log-level", "warn", *options,
                             stdout=subprocess.PIPE, stderr=self.log, text=True)
        self.address = self.process.stdout.readline().split()[-1]

    def list_sessions(self, times=1):
        for _ in range(times):
            result = subprocess.run([self.tissueform, "session", "list", "--server", self.address], capture_output=True, text=True, check=False)
            check(result.returncode == 0, "the server answers", result.stderr)


class Rsyslog:
    """A collector on a free port, or on the port of an earlier one."""

    def __init__(self, folder, port="0"):
        for name in ("events", "port"):
            (folder / name).unlink(missing_ok=True)
        self.events_file = folder / "events"
        (folder / "rsyslog.conf").write_text(f"""
global(workDirectory="{folder}" defaultNetstreamDriver="ossl" defaultNetstreamDriverCAFile="{folder}/ca.pem"
       defaultNetstreamDriverCertFile="{folder}/collector.pem" defaultNetstreamDriverKeyFile="{folder}/collector.key")
module(load="imtcp" streamDriver.name="ossl" streamDriver.mode="1" streamDriver.authMode="x509/name" permittedPeer=["planning-server"])
input(type="imtcp" address="127.0.0.1" port="{port}" listenPortFileName="{folder}/port")
{TEMPLATE}
action(type="omfile" file="{self.events_file}" template="events")
""")
        self.process = start("/usr/sbin/rsyslogd", "-n", "-f", folder / "rsyslog.conf", "-i", folder / "rsyslog.pid", stderr=subprocess.DEVNULL)
        if port == "0":
            wait_for("rsyslog takes a free port", lambda: (folder / "port").exists() and (folder / "port").read_text().strip())
            port = (folder / "port").read_text().strip()
        self.port = port
        wait_for("rsyslog listens", self.listens)

    def listens(self):
        with contextlib.suppress(ConnectionRefusedError), socket.create_connection(("127.0.0.1", int(self.port))):
            return True
        return False

    def events(self, program="tissueform-server"):
        """All but rsyslog's own."""
        lines = self.events_file.read_text().splitlines() if self.events_file.exists() else []
        return [event for event in map(json.loads, lines) if event["app"] == program]


def make_certificates(folder):
    def openssl(*arguments):
        subprocess.run(["openssl", *arguments], cwd=folder, check=True, capture_output=True)
    new = ("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-noenc", "-days", "2")
    openssl(*new, "-subj", "/CN=authority", "-keyout", "ca.key", "-out", "ca.pem")
    for name, common in (("collector", "localhost"), ("server", "planning-server")):
        openssl(*new, "-CA", "ca.pem", "-CAkey", "ca.key", "-subj", f"/CN={common}", "-addext", f"subjectAltName=DNS:localhost,DNS:{common},IP:127.0.0.1",
                "-addext", "basicConstraints=critical,CA:FALSE", "-keyout", f"{name}.key", "-out", f"{name}.pem")


def sequence(event):
    data = event["data"]
    if not (data.startswith('[meta sequenceId="') and data.endswith('"]')):
        raise SystemExit(f"WRONG: structured data {data}")
    return int(data.split('"')[1])


def look_at_collector(programs, folder):
    make_certificates(folder)
    collector = Rsyslog(folder)
    options = ("--audit", f"syslog://localhost:{collector.port}", "--audit-ca", folder / "ca.pem")
    identity = ("--tls-cert", folder / "server.pem", "--tls-key", folder / "server.key")
    server = Server(programs, folder, *options, *identity)
    client = ("--tls-ca", folder / "ca.pem")

    def list_sessions(times):
        for _ in range(times):
            result = subprocess.run([programs[1], "session", "list", "--server", server.address.replace("127.0.0.1", "localhost"), *client], capture_output=True, text=True, check=False)
            if result.returncode != 0:
                raise SystemExit(f"WRONG: the server does not answer: {result.stderr}")

    list_sessions(5)
    wait_for("rsyslog has the calls", lambda: len(collector.events()) == 5)
    event = collector.events()[0]
    check(event["pri"] == "85" and event["id"] == "tissueform-call" and event["process"] == str(server.process.pid), "rsyslog finds the header right", event)
    call = json.loads(event["text"])
    check(call["rpc"] == "SessionService.ListSessions" and call["code"] == "OK" and call["address"] == "127.0.0.1", "and the text is the call", call)
    check([sequence(event) for event in collector.events()] == [1, 2, 3, 4, 5], "in order, once")

    end(collector.process)
    list_sessions(3)
    time.sleep(0.2)
    end(server.process, signal.SIGKILL)
    server = Server(programs, folder, *options, *identity)
    list_sessions(2)
    collector = Rsyslog(folder, collector.port)
    wait_for("a collector that was away gets all, also of a server that was killed", lambda: {sequence(event) for event in collector.events()} >= set(range(6, 11)))
    check({sequence(event) for event in collector.events()} <= set(range(1, 11)), "and nothing else", collector.events())
    check(end(server.process) == 0, "the server ends")
    end(collector.process)


def look_at_bridge(program, folder):
    make_certificates(folder)
    collector = Rsyslog(folder)
    bridge = start(program, "listen", "--state-dir", folder / "state", "--listen", "127.0.0.1:0", "--allow-ae", "SCANNER", "--log-level", "warn",
                   "--audit", f"syslog://localhost:{collector.port}", "--audit-ca", folder / "ca.pem",
                   "--dicom-cert", folder / "server.pem", "--dicom-key", folder / "server.key", "--dicom-ca", folder / "ca.pem", stdout=subprocess.PIPE, text=True)
    port = bridge.stdout.readline().strip().rsplit(":", 1)[1]
    (folder / "object.txt").write_text(OBJECT)
    subprocess.run(["dump2dcm", folder / "object.txt", folder / "object.dcm"], check=True, capture_output=True)
    sent = subprocess.run(["storescu", "--enable-tls", folder / "collector.key", folder / "collector.pem", "--add-cert-file", folder / "ca.pem", "-aet", "SCANNER",
                           "-aec", "TISSUEFORM", "localhost", port, folder / "object.dcm"], capture_output=True, text=True, check=False)
    check(sent.returncode == 0, "storescu sends", sent.stderr)
    check(end(bridge) == 0, "the bridge ends")
    wait_for("rsyslog has four messages", lambda: len(collector.events("tissueform-pacs")) == 4)
    events = collector.events("tissueform-pacs")
    check({(event["id"], event["pri"]) for event in events} == {("DICOM+RFC3881", "85")}, "with the header of a DICOM audit message", events)
    for number, event in enumerate(events):
        (folder / f"{number}.xml").write_text(event["text"])
    schema = subprocess.run(["xmllint", "--noout", "--relaxng", SCHEMA, *(folder / f"{number}.xml" for number in range(4))], capture_output=True, text=True, check=False)
    check(schema.returncode == 0, "xmllint finds them right", schema.stderr)
    codes = [re.findall(r'<Event(?:ID|TypeCode) csd-code="(\d+)"', event["text"]) for event in events]
    check(codes == [["110100", "110120"], ["110102"], ["110104"], ["110100", "110121"]], "start, begin, transferred, stop", codes)
    transferred = events[2]["text"]
    check('ParticipantObjectID="1.2.3.1"' in transferred and 'ParticipantObjectID="PLANTED-4711"' in transferred and 'UserID="SCANNER"' in transferred,
          "with study, patient ID and sender", transferred)
    check("Patricia" not in "".join(event["text"] for event in events), "and without the patient's name")
    end(collector.process)


def ask_review_page(address, user, password):
    """The status of the page's answer."""
    credentials = base64.b64encode(f"{user}:{password}".encode()).decode()
    try:
        return urllib.request.urlopen(urllib.request.Request(address, headers={"Authorization": f"Basic {credentials}"}), timeout=PATIENCE_S).status
    except urllib.error.HTTPError as error:
        return error.code


def look_at_visitors(program, folder):
    """Strangers at the receiver, and users and strangers at the review page."""
    collector = Rsyslog(folder)
    (folder / "password").touch(mode=0o600)
    (folder / "password").write_text("correct horse battery staple\n")
    bridge = start(program, "run", "--state-dir", folder / "visited", "--listen", "127.0.0.1:0", "--allow-ae", "SCANNER", "--log-level", "warn",
                   "--server", "127.0.0.1:1", "--recipe", ROOT / "deploy/pacs/recipe.json", "--review-listen", "127.0.0.1:0", "--review-token-file", folder / "password",
                   "--audit", f"syslog://localhost:{collector.port}", "--audit-ca", folder / "ca.pem",
                   "--dicom-cert", folder / "server.pem", "--dicom-key", folder / "server.key", "--dicom-ca", folder / "ca.pem", stdout=subprocess.PIPE, text=True)
    port = bridge.stdout.readline().strip().rsplit(":", 1)[1]
    page = bridge.stdout.readline().split()[-1]
    subprocess.run(["echoscu", "--enable-tls", folder / "collector.key", folder / "collector.pem", "--add-cert-file", folder / "ca.pem", "-aet", "STRANGER",
                    "-aec", "TISSUEFORM", "localhost", port], capture_output=True, check=False)
    # The receiver and the page record from two threads: without this wait the login may be first.
    wait_for("rsyslog has the stranger", lambda: any('UserID="STRANGER"' in event["text"] for event in collector.events("tissueform-pacs")))
    check([ask_review_page(page, "ada", "correct horse battery staple") for _ in range(3)] == [200, 200, 200], "the review page takes its password")
    check({ask_review_page(page, "eve", "a guess") for _ in range(20)} == {401}, "and no other")
    check(end(bridge) == 0, "the bridge ends")
    wait_for("rsyslog has the stop", lambda: any('csd-code="110121"' in event["text"] for event in collector.events("tissueform-pacs")))
    texts = [event["text"] for event in collector.events("tissueform-pacs")][1:-1]
    found = [(re.search(r'<EventID csd-code="(\d+)"', text)[1], re.search(r'UserID="([^"]*)"', text)[1], re.search('OutcomeIndicator="(.)"', text)[1]) for text in texts]
    # A refusal of the receiver and four of the page are five from this address; the last event has the number of the others.
    check(found[:2] == [("110113", "STRANGER", "8"), ("110114", "ada", "0")], "a stranger and a login are recorded once", found)
    check(found[2:-1] == [("110114", "eve", "8")] * 4 and "16 more refusals" in texts[-1], "guesses are recorded up to the limit, and counted beyond", found)
    check("staple" not in "".join(texts) and "guess" not in "".join(texts), "without a password")
    end(collector.process)


def look_at_refusals(programs, folder):
    for options, reason in ((("--audit-log", "audit.jsonl"), "--audit-log: removed; give --audit journal or --audit syslog://HOST:PORT"),
                            (("--audit-syslog",), "--audit-syslog: removed; give"),
                            (("--audit", "audit.jsonl"), "--audit: give journal or syslog://HOST:PORT")):
        result = subprocess.run([programs[0], "--data-dir", folder / "data", *options], capture_output=True, text=True, check=False)
        check(result.returncode == 2 and reason in result.stderr and result.stderr.count("\n") == 1, f"{options[0]} is refused in one line", result.stderr)
    (folder / "old.ini").write_text("audit-log = audit.jsonl\n")
    result = subprocess.run([programs[0], "--config", folder / "old.ini"], capture_output=True, text=True, check=False)
    check(result.returncode == 2 and "removed; give --audit journal" in result.stderr, "also in a file", result.stderr)


def journal_entries():
    output = subprocess.run(["journalctl", "--directory", "/run/log/journal", "--identifier", "tissueform-server-audit", "--output", "json", "--no-pager"],
                          capture_output=True, text=True, check=True).stdout
    return [json.loads(line) for line in output.splitlines()]


def start_journald():
    journald = start(JOURNALD, stderr=subprocess.DEVNULL)
    wait_for("journald listens", lambda: pathlib.Path("/run/systemd/journal/socket").is_socket())
    return journald


def look_at_journal(programs, folder):
    subprocess.run(["mount", "-t", "tmpfs", "tmpfs", "/run"], check=True)
    refused = subprocess.run([programs[0], "--port", "0", "--in-memory", "--audit", "journal"], capture_output=True, text=True, check=False)
    check(refused.returncode == 1 and "start systemd-journald" in refused.stderr, "without a journal the server does not start", refused.stderr)
    journald = start_journald()
    server = Server(programs, folder, "--audit", "journal")
    server.list_sessions(3)
    wait_for("journalctl prints the calls", lambda: len(journal_entries()) == 3)
    entry = journal_entries()[0]
    call = json.loads(entry["MESSAGE"])
    check(call["rpc"] == "SessionService.ListSessions" and call["code"] == "OK", "the message is the call", entry)
    check(entry["PRIORITY"] == "5" and entry["SYSLOG_FACILITY"] == "10" and entry["_PID"] == str(server.process.pid), "its fields are right", entry)
    end(journald)
    journald = start_journald()
    server.process.send_signal(signal.SIGHUP)  # as log rotation does
    server.list_sessions(1)
    wait_for("a journald that was restarted has the next call", lambda: len(journal_entries()) == 4)
    check(end(server.process) == 0, "the server ends")
    end(journald)


def main():
    kind, programs = sys.argv[1], sys.argv[2:]
    needed = {"bridge": ["/usr/sbin/rsyslogd", "openssl", "dump2dcm", "storescu", "echoscu", "xmllint"], "collector": ["/usr/sbin/rsyslogd", "openssl"],
              "journal": [JOURNALD, "journalctl", "unshare"]}[kind]
    if any(shutil.which(program) is None for program in needed):
        print(f"missing: one of {needed}; deploy/packages.txt lists them")
        sys.exit(77)
    if kind == "journal" and "TISSUEFORM_IN_NAMESPACE" not in os.environ:
        namespaces = ["unshare", "--user", "--map-root-user", "--mount"]
        if subprocess.run([*namespaces, "true"], capture_output=True, check=False).returncode != 0:
            print("this machine allows no user namespaces")
            sys.exit(77)
        sys.exit(subprocess.run([*namespaces, sys.executable, *sys.argv], env={**os.environ, "TISSUEFORM_IN_NAMESPACE": "1"}, check=False).returncode)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        try:
            if kind == "journal":
                look_at_journal(programs, folder)
            elif kind == "bridge":
                look_at_bridge(programs[0], folder)
                look_at_visitors(programs[0], folder)
            else:
                look_at_refusals(programs, folder)
                look_at_collector(programs, folder)
        finally:
            for process in started:
                process.kill()


if __name__ == "__main__":
    main()
