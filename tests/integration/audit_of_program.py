#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The audit log of the real server through rotation, kill -9 and a restart, verified by Python's own hmac and json.

  audit_of_program.py SERVER TISSUEFORM
"""

import hmac
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

PATIENCE_S = 60


class Server:
    def __init__(self, program, folder):
        self.process = subprocess.Popen([program, "--port", "0", "--in-memory", "--log-level", "off", "--audit-log",
                                         folder / "audit.jsonl", "--audit-key", folder / "key"], stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().split()[-1]

    def end(self, number):
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)


def wait_for(what, condition):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f"WRONG: {what}")
        time.sleep(0.01)
    print("right:", what)


def lines_of(path):
    return path.read_bytes().splitlines(keepends=True) if path.exists() else []


def verify(paths, key):
    """As docs/operations.md and server/platform/audit_chain/audit_chain.h have the form, with no code of ours."""
    previous, number = b"0" * 64, 0
    for path in paths:
        for line in lines_of(path):
            body, mac = line[:-3 - 64 - 8], line[-3 - 64:-3]
            fields = json.loads(line)
            number += 1
            if fields["n"] != number or fields["mac"].encode() != mac or not line.endswith(b'"}\n'):
                raise SystemExit(f"WRONG: line {number} of {path.name}")
            if hmac.new(key, previous + body, "sha256").hexdigest().encode() != mac:
                raise SystemExit(f"WRONG: line {number} is not sealed")
            previous = mac
    print("right: Python finds every line sealed")


def main():
    server_platform, tissueform = sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        log, moved = folder / "audit.jsonl", folder / "audit.jsonl.1"

        def run(*arguments):
            return subprocess.run([tissueform, *arguments], capture_output=True, text=True, check=False)

        def list_sessions(server):
            if run("session", "list", "--server", server.address).returncode != 0:
                raise SystemExit("WRONG: the server does not answer")

        run("audit", "keygen", folder / "key")
        server = Server(server_platform, folder)
        list_sessions(server)
        wait_for("a call is told", lambda: b"SessionService.ListSessions" in log.read_bytes())
        log.rename(moved)
        server.process.send_signal(signal.SIGHUP)
        wait_for("SIGHUP begins a new file", lambda: b'"event":"begin","file":2' in b"".join(lines_of(log)))
        list_sessions(server)
        wait_for("calls go there", lambda: len(lines_of(log)) == 2)
        server.end(signal.SIGKILL)
        with log.open("ab") as torn:
            torn.write(b'{"n":5,"event":"ca')

        server = Server(server_platform, folder)
        list_sessions(server)
        wait_for("a torn line is noted", lambda: b'"event":"mended","bytes":18' in log.read_bytes())
        code = server.end(signal.SIGTERM)
        print("right: it ends" if code == 0 else f"WRONG: exit code {code}")
        verify([moved, log], bytes.fromhex((folder / "key").read_text().strip()))
        told = run("audit", "verify", log, moved, "--key", folder / "key")
        print(told.stdout, told.stderr)
        sys.exit(0 if code == 0 and told.stdout.startswith("ok: 6 lines in 2 files") else 1)


if __name__ == "__main__":
    main()
