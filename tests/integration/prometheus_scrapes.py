#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Debian's prometheus scrapes a server and a gateway by deploy/prometheus; promtool reads their pages and our rules.

  prometheus_scrapes.py SERVER GATEWAY SOURCE_FOLDER

Exit code 77 when prometheus or promtool is missing.
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "deploy"))
from free_ports import free_ports

PATIENCE_S = 60

# On the page of a server with TLS and tokens only.
WITH_TLS_AND_TOKENS = {"tissueform_certificate_expiry_timestamp_seconds", "tissueform_credentials_alarm",
                       "tissueform_token_failures_total"}
# tests/server/cluster looks for these on a node's page.
OF_A_NODE = {"tissueform_lease_renewal_age_seconds", "tissueform_sessions_lost_total", "tissueform_node_name_taken"}


failures = []


def expect(holds, what, why=""):
    """A line each; the exit code shows whether all were right."""
    print("right:" if holds else "WRONG:", what, "" if holds else why)
    if not holds:
        failures.append(what)


class Program:
    """One of ours, which reports its port of metrics in its log, and a line on stdout when it is ready."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen([*arguments, "--metrics-port", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.metrics_port = None
        while self.metrics_port is None:
            line = self.process.stderr.readline()
            if not line:
                raise SystemExit(f"{arguments[0]} ended")
            found = re.search(r"metrics on http://127\.0\.0\.1:(\d+)/metrics", line)
            self.metrics_port = found and int(found[1])
        threading.Thread(target=self.process.stderr.read, daemon=True).start()
        self.address = self.process.stdout.readline().split()[-1]

    def page(self):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.metrics_port}/metrics", timeout=PATIENCE_S) as reply:
            return reply.read().decode()

    def end(self):
        self.process.terminate()
        self.process.wait(PATIENCE_S)


def check_page(page):
    checked = subprocess.run(["promtool", "check", "metrics"], input=page, capture_output=True, text=True, check=False)
    expect(checked.returncode == 0 and not checked.stderr, "promtool checks the page", checked.stdout + checked.stderr)


def names_of(page):
    families = set(re.findall(r"^# TYPE (\S+)", page, re.MULTILINE))
    return families | {name + suffix for name in families for suffix in ("_bucket", "_count", "_sum")}


def names_in(expressions):
    return {name for text in expressions for name in re.findall(r"\b(?:tissueform|process)_[a-z0-9_]+", text)}


def check_names(source, pages):
    dashboard = json.loads((source / "deploy/grafana/tissueform.json").read_text())
    rules = (source / "deploy/prometheus/tissueform.rules.yml").read_text()
    used = {"dashboard": [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]],
            "rules": re.findall(r"^ +expr: (.*)$", rules, re.MULTILINE)}
    for where, expressions in used.items():
        unknown = names_in(expressions) - pages - WITH_TLS_AND_TOKENS - OF_A_NODE
        expect(len(expressions) > 15 and not unknown, f"all names of the {where} are on a page", sorted(unknown))


def check_rules(folder):
    for what in ("check", "test"):
        name = "tissueform.rules.yml" if what == "check" else "tissueform.tests.yml"
        done = subprocess.run(["promtool", what, "rules", name], cwd=folder, capture_output=True, text=True, check=False)
        expect(done.returncode == 0, f"promtool {what} rules", done.stdout + done.stderr)


def ask(port, path):
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/api/v1/{path}", timeout=PATIENCE_S) as reply:
        return json.load(reply)["data"]


def scrape(folder, source, ports):
    """Runs prometheus by our own configuration, with the ports of these programs."""
    text = (source / "deploy/prometheus/prometheus.yml").read_text().replace("15s", "1s")
    for kept, ours in zip(("9464", "9465"), ports):
        text = text.replace(kept, str(ours))
    (folder / "prometheus.yml").write_text(text)
    shutil.copy(source / "deploy/prometheus/tissueform.rules.yml", folder)
    (port,) = free_ports(1)
    process = subprocess.Popen(["prometheus", f"--config.file={folder}/prometheus.yml", f"--storage.tsdb.path={folder}/data",
                                f"--web.listen-address=127.0.0.1:{port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        up = []
        end = time.monotonic() + PATIENCE_S
        while len(up) < 2 and process.poll() is None and time.monotonic() < end:
            time.sleep(0.1)
            try:
                up = [target for target in ask(port, "targets")["activeTargets"] if target["health"] == "up"]
            except (urllib.error.URLError, ConnectionError):
                continue
        jobs = sorted(target["labels"]["job"] for target in up)
        expect(jobs == ["tissueform", "tissueform-gateway"], "prometheus scrapes both programs", jobs)
        expect(len(ask(port, "rules")["groups"][0]["rules"]) > 15, "prometheus has the rules")
        found = []
        # A target is up a moment before what it has reported is kept.
        while not found and process.poll() is None and time.monotonic() < end:
            found = ask(port, "query?query=tissueform_build_info")["result"]
            time.sleep(0.1)
        expect([sample["value"][1] for sample in found] == ["1"], "a metric is found again", found)
    finally:
        process.terminate()
        process.wait()


def main():
    server_platform, gateway_program, source = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
    if shutil.which("prometheus") is None or shutil.which("promtool") is None:
        print("prometheus is missing: deploy/packages.txt lists it")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        # Nothing listens on port 9: events wait in the buffer, and the page has their metrics.
        server = Program(server_platform, "--port", "0", "--data-dir", f"{folder}/kept", "--audit", "syslog://localhost:9")
        gateway = Program(gateway_program, "--listen", "127.0.0.1:0", "--server", server.address)
        try:
            pages = [server.page(), gateway.page()]
            for page in pages:
                check_page(page)
            check_names(source, set().union(*map(names_of, pages)))
            check_rules(source / "deploy/prometheus")
            scrape(folder, source, [server.metrics_port, gateway.metrics_port])
        finally:
            gateway.end()
            server.end()
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
