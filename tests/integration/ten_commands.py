#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Runs the ten commands of docs/operations.md as they stand, in a scratch folder, and looks at what they leave.

    tests/integration/ten_commands.py FOLDER_OF_PROGRAMS

Each of them succeeds; the server speaks TLS to openssl; nobody else may read what is secret, and no log, no metric and
no printed configuration holds it.
"""

import contextlib
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "deploy"))
from free_ports import free_ports

HEADING = "## From nothing to a monitored server in ten commands"
COMMANDS = 10
PATIENCE_S = 100


def block():
    page = (ROOT / "docs/operations.md").read_text()
    found = re.search(re.escape(HEADING) + r"\n.*?```sh\n(.*?)```", page, flags=re.DOTALL)
    assert found, "docs/operations.md has no block of commands"
    text = found.group(1)
    assert re.findall(r"^# (\d+)\. ", text, flags=re.MULTILINE) == [str(n + 1) for n in range(COMMANDS)], "not ten commands"
    return text


def check(condition, what):
    assert condition, what
    print(f"ok: {what}", flush=True)


def secrets(folder):
    """What must be nowhere else: lines of keys, the token, the key of the audit log."""
    found = [(folder / "token").read_text().strip(), (folder / "audit.key").read_text().strip()]
    for name in ("ca.key", "server.key", "keys/private.pem"):
        found += [line for line in (folder / name).read_text().splitlines() if line and not line.startswith("-----")]
    return found


def look(folder, programs, port, metrics_port):
    printed = subprocess.run([programs / "tissueform-server", "--config", "server.ini", "--print-config"], cwd=folder, capture_output=True, text=True, check=True).stdout
    check("token-keys = keys/jwks.json\n" in printed, "the configuration prints as it was given")
    metrics = urllib.request.urlopen(f"http://127.0.0.1:{metrics_port}/metrics", timeout=PATIENCE_S).read().decode()
    check("tissueform_" in metrics, "Prometheus finds metrics")
    told = printed + metrics + "".join((folder / name).read_text() for name in ("server.log", "server.out", "audit.jsonl"))
    check(not [secret for secret in secrets(folder) if secret in told], "no secret is in logs, metrics, audit or configuration")
    for name in ("token", "audit.key", "keys/private.pem", "ca.key", "server.key", "data"):
        check((folder / name).stat().st_mode & 0o077 == 0, f"{name} is its owner's alone")
    tls = subprocess.run(["openssl", "s_client", "-connect", f"localhost:{port}", "-CAfile", "ca.pem", "-verify_return_error", "-verify_hostname", "localhost", "-alpn", "h2"],
                         cwd=folder, input="", capture_output=True, text=True, errors="replace", timeout=PATIENCE_S)  # HTTP/2 may come, too
    check("Verify return code: 0 (ok)" in tls.stdout, "openssl finds the server's certificate right")
    backups = list(folder.glob("backup-*"))
    check(len(backups) == 1 and subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=backups[0], check=False).returncode == 0, "sha256sum finds the backup whole")


def main(programs):
    commands = block()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        port, metrics_port = map(str, free_ports(2))
        environment = {"PATH": f"{programs}:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": name, "PORT": port, "METRICS": metrics_port, "LANG": "C.UTF-8"}
        # A group of its own, so that the server that they leave running can be ended with it.
        shell = subprocess.Popen(["bash", "-euo", "pipefail", "-c", commands], cwd=folder, env=environment, start_new_session=True)
        try:
            code = shell.wait(PATIENCE_S)
            if code != 0:
                print((folder / "server.log").read_text() if (folder / "server.log").exists() else "no server", file=sys.stderr)
            check(code == 0, "ten commands succeed")
            look(folder, programs, port, metrics_port)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(shell.pid, signal.SIGTERM)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]).resolve())
