#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Is systemd for a server and a gateway, as a unit of Type=notify with a watchdog sees them.

    tests/integration/service_notices.py FOLDER_OF_PROGRAMS

They listen before they say so, are heard of again and again, report when they drain, and end with 0.
"""

import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile

PATIENCE_S = 60


def serve(scratch, *words):
    """Runs a service until it was heard of three times, then ends it; returns what it has said of itself."""
    path = str(scratch / "notify")
    heard = []
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notices:
        notices.bind(path)
        notices.settimeout(PATIENCE_S)
        environment = dict(os.environ, NOTIFY_SOCKET=path, WATCHDOG_USEC="200000")
        environment.pop("WATCHDOG_PID", None)
        process = subprocess.Popen([str(word) for word in words], env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            while "READY=1" not in heard or heard.count("WATCHDOG=1") < 3:
                heard.append(notices.recv(1000).decode())
            # On stdout before READY: what waits for the unit finds a port that answers.
            line = process.stdout.readline()
            assert line.startswith("listening on "), line
            host, _, port = line.split()[-1].removeprefix("http://").rpartition(":")
            socket.create_connection((host, int(port)), timeout=PATIENCE_S).close()
            process.send_signal(signal.SIGTERM)
            while heard[-1] != "STOPPING=1":
                heard.append(notices.recv(1000).decode())
            assert process.wait(PATIENCE_S) == 0, process.returncode
        finally:
            process.kill()
            process.wait()
    os.unlink(path)
    return heard


def main(programs):
    with tempfile.TemporaryDirectory() as folder:
        scratch = pathlib.Path(folder)
        for words in ([programs / "tissueform-server", "--in-memory", "--port", "0"],
                      [programs / "tissueform-gateway", "--server", "127.0.0.1:1", "--listen", "127.0.0.1:0"]):
            heard = serve(scratch, *words)
            assert heard.count("READY=1") == 1 and set(heard) == {"READY=1", "WATCHDOG=1", "STOPPING=1"}, heard
            print(f"ok: {words[0].name}: {' '.join(heard)}")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]).resolve())
