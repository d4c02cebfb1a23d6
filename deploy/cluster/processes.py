# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Processes that outlive the script that starts them, and that another run of it finds and ends.

A process is known by its id and by when it began, so that one that came later under the same id is never taken for it.
"""

import contextlib
import os
import pathlib
import signal
import socket
import subprocess
import time

HOST = "127.0.0.1"
ROOT = pathlib.Path(__file__).resolve().parents[2]
SYSTEM_PATH = "/usr/sbin:/usr/bin:/sbin:/bin:/usr/local/bin"
PATIENCE_S = 60


def birth(pid):
    """When a process began, in ticks since the machine did; None: there is none, or it has ended and nobody asked."""
    try:
        fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except (OSError, IndexError):
        return None
    return None if fields[0] == "Z" else int(fields[19])


def is_running(process):
    return process is not None and birth(process["pid"]) == process["birth"]


def start(command, log, cpus=None, environment=None, user=None):
    """Starts a program in a session of its own, what it says at the end of the log; {"pid", "birth"}."""
    if cpus is not None:
        command = ["taskset", "--cpu-list", cpus, *command]
    as_user = {} if user is None else {"user": user, "group": user, "extra_groups": []}
    with open(log, "ab") as output:
        child = subprocess.Popen([str(word) for word in command], stdin=subprocess.DEVNULL, stdout=output, stderr=output, start_new_session=True,
                                 cwd="/", env=os.environ | (environment or {}), **as_user)
    _children.append(child)
    return {"pid": child.pid, "birth": birth(child.pid)}


_children = []


def reap():
    """Children that have ended leave the table of processes."""
    _children[:] = [child for child in _children if child.poll() is None]


def send(process, how):
    if is_running(process):
        with contextlib.suppress(ProcessLookupError):
            os.kill(process["pid"], how)


def wait_until_gone(process, patience_s=PATIENCE_S):
    end = time.monotonic() + patience_s
    while is_running(process) and time.monotonic() < end:
        reap()
        time.sleep(0.02)
    return not is_running(process)


def stop(process, how=signal.SIGTERM, patience_s=PATIENCE_S):
    """Ends it kindly, or not at all kindly when that takes too long."""
    send(process, signal.SIGCONT)
    send(process, how)
    if not wait_until_gone(process, patience_s):
        send(process, signal.SIGKILL)
        wait_until_gone(process)


def wait_for(what, check, process, log, patience_s=PATIENCE_S):
    """Asks until it is true; that the process ends meanwhile is an error."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        if check():
            return
        reap()
        if not is_running(process):
            break
        time.sleep(0.05)
    tail = pathlib.Path(log).read_text(errors="replace")[-1500:]
    raise SystemExit(f"{what} did not start; the end of {log}:\n{tail}")


def accepts(port):
    """Whether somebody listens there."""
    try:
        socket.create_connection((HOST, port), timeout=1).close()
    except OSError:
        return False
    return True
