#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Runs the first commands of docs/operations.md as they stand, in a scratch folder, and looks at what they leave.

    tests/integration/first_commands.py FOLDER_OF_PROGRAMS

Each of them succeeds; the server speaks TLS to openssl; nobody else may read what is secret, and no log, no metric and
no printed configuration holds it. Where a port is taken they end with the reason; run again in the same folder they succeed,
also while the server of the run before still runs.
"""

import contextlib
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "deploy"))
from free_ports import free_ports

HEADING = "## From nothing to a monitored server in nine commands"
COMMANDS = 9
PATIENCE_S = 100


def block():
    page = (ROOT / "docs/operations.md").read_text()
    found = re.search(re.escape(HEADING) + r"\n.*?```sh\n(.*?)```", page, flags=re.DOTALL)
    assert found, "docs/operations.md has no block of commands"
    text = found.group(1)
    assert re.findall(r"^# (\d+)\. ", text, flags=re.MULTILINE) == [str(n + 1) for n in range(COMMANDS)], "not nine commands"
    return text


def check(condition, what):
    assert condition, what
    print(f"ok: {what}", flush=True)


def secrets(folder):
    """What must be nowhere else: lines of keys, the token."""
    return [(folder / "token").read_text().strip(), *kept_secrets(folder)]


def kept_secrets(folder):
    found = []
    for name in ("ca.key", "server.key", "keys/private.pem"):
        found += [line for line in (folder / name).read_text().splitlines() if line and not line.startswith("-----")]
    return found


def run(folder, programs, port, metrics_port, options=("-euo", "pipefail")):
    """The commands, in a session of their own; the server that they leave running is of that, too."""
    # With the options of sanitizers, whose suppressions a program that is started must know.
    sanitizers = {name: value for name, value in os.environ.items() if name.endswith("SAN_OPTIONS")}
    environment = {"PATH": f"{programs}:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": str(folder), "PORT": str(port), "METRICS": str(metrics_port), "LANG": "C.UTF-8", **sanitizers}
    with open(folder / "output", "w+") as output:
        shell = subprocess.Popen(["bash", *options, "-c", block()], cwd=folder, env=environment, stdout=output, stderr=subprocess.STDOUT,
                                 start_new_session=True)
        try:
            code = shell.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            os.killpg(shell.pid, signal.SIGKILL)
            raise
        output.seek(0)
        return code, output.read()


def stop(folder):
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        os.kill(int((folder / "server.pid").read_text()), signal.SIGTERM)


def look_at_taken_ports(folder, programs, port, metrics_port):
    """As a script, and as somebody pastes them, where what follows goes on after an error."""
    for taken, options in ((port, ("-euo", "pipefail")), (port, ()), (metrics_port, ("-euo", "pipefail"))):
        with socket.create_server(("127.0.0.1", taken)):
            code, output = run(folder, programs, port, metrics_port, options)
        check(code != 0 or not options, f"a taken port ends them ({' '.join(options) or 'pasted'})")
        check(re.search(rf"cannot listen on 127.0.0.1:{taken}: .*--port|port {taken} .*is not available.*--metrics-port", output), f"they name the port {'PORT' if taken == port else 'METRICS'} and its option")


def look(folder, programs, port, metrics_port, runs):
    printed = subprocess.run([programs / "tissueform-server", "--config", "server.ini", "--print-config"], cwd=folder, capture_output=True, text=True, check=True).stdout
    check("token-keys = keys/jwks.json\n" in printed, "the configuration prints as it was given")
    metrics = urllib.request.urlopen(f"http://127.0.0.1:{metrics_port}/metrics", timeout=PATIENCE_S).read().decode()
    check("tissueform_" in metrics, "Prometheus finds metrics")
    exposed = printed + metrics + "".join((folder / name).read_text() for name in ("server.log", "server.out"))
    check(not [secret for secret in secrets(folder) if secret in exposed], "no secret is in logs, metrics or configuration")
    for name in ("token", "keys/private.pem", "ca.key", "server.key", "data"):
        check((folder / name).stat().st_mode & 0o077 == 0, f"{name} is its owner's alone")
    tls = subprocess.run(["openssl", "s_client", "-connect", f"localhost:{port}", "-CAfile", "ca.pem", "-verify_return_error", "-verify_hostname", "localhost", "-alpn", "h2"],
                         cwd=folder, input="", capture_output=True, text=True, errors="replace", timeout=PATIENCE_S)  # HTTP/2 may come, too
    check("Verify return code: 0 (ok)" in tls.stdout, "openssl finds the server's certificate right")
    backups = list(folder.glob("backup-*"))
    check(len(backups) == runs and subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=max(backups), check=False).returncode == 0, "sha256sum finds the backup whole")


def main(programs):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        port, metrics_port = free_ports(2)
        try:
            look_at_taken_ports(folder, programs, port, metrics_port)
            backups = len(list(folder.glob("backup-*")))
            keys = None
            for again in range(2):
                code, output = run(folder, programs, port, metrics_port)
                check(code == 0, f"the commands succeed{' again' if again else ''}" if code == 0 else output)
                look(folder, programs, port, metrics_port, backups + again + 1)
                check(keys in (None, kept_secrets(folder)), "keys are as they were")
                keys = kept_secrets(folder)
        finally:
            stop(folder)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]).resolve())
