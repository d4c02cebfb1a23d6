# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A PostgreSQL server of its own, which knows one user and listens on loopback alone.

PostgreSQL refuses root: where root starts it, it runs as Debian's user postgres, and its files lie where that user may go.
"""

import glob
import os
import pathlib
import pwd
import secrets
import shutil
import signal
import subprocess
import tempfile

import processes

USER, NAME = "tissueform", "tissueform"
POSTGRES_USER = "postgres"
OUTSIDE = "/var/tmp"


def program(name):
    """Path of a program of PostgreSQL, the newest that is installed; None."""
    found = sorted(glob.glob(f"/usr/lib/postgresql/*/bin/{name}"), key=lambda path: int(path.split("/")[4]))
    return found[-1] if found else shutil.which(name)


def runs_as():
    """Whose process it is; None: ours."""
    return POSTGRES_USER if os.geteuid() == 0 else None


def make(folder):
    """Makes the files of a database server below the folder; what the state keeps of it."""
    password_file = pathlib.Path(folder) / "database_password"
    password_file.touch(mode=0o600)
    password_file.write_text(secrets.token_urlsafe(24) + "\n")
    if runs_as() is None:
        data = pathlib.Path(folder) / "postgresql"
        data.mkdir(mode=0o700)
    else:
        data = pathlib.Path(tempfile.mkdtemp(prefix="tissueform-cluster-", dir=OUTSIDE))
        owner = pwd.getpwnam(POSTGRES_USER)
        os.chown(data, owner.pw_uid, owner.pw_gid)
    return {"data": str(data), "password_file": str(password_file), "made": False}


def initialise(database, log):
    """Fills the files; the password comes by a pipe, since the server's user may not read ours."""
    as_user = {} if runs_as() is None else {"user": runs_as(), "group": runs_as(), "extra_groups": []}
    password = pathlib.Path(database["password_file"]).read_bytes()
    read_end, write_end = os.pipe()
    os.write(write_end, password)
    os.close(write_end)
    if runs_as() is not None:
        os.fchown(read_end, pwd.getpwnam(runs_as()).pw_uid, -1)
    with open(log, "ab") as output:
        done = subprocess.run([program("initdb"), "--pgdata", database["data"], "--username", USER, "--auth", "scram-sha-256", "--encoding", "UTF8",
                               "--locale", "C.UTF-8", f"--pwfile=/dev/fd/{read_end}"],
                              stdout=output, stderr=output, stdin=subprocess.DEVNULL, pass_fds=[read_end], cwd="/", check=False, timeout=120, **as_user)
    os.close(read_end)
    if done.returncode != 0:
        raise SystemExit(f"initdb failed; see {log}")


def start(database, port, log, cpus=None):
    """Starts it and waits until it answers; the process."""
    pathlib.Path(database["data"], "postmaster.pid").unlink(missing_ok=True)
    process = processes.start([program("postgres"), "-D", database["data"], "-p", port, "-c", f"listen_addresses={processes.HOST}",
                               "-c", "unix_socket_directories="], log, cpus=cpus, user=runs_as())
    processes.wait_for("PostgreSQL", lambda: answers(database, port), process, log)
    return process


def stop(process):
    """At once for its clients, and whole."""
    processes.stop(process, signal.SIGINT)


def answers(database, port):
    return ask(database, port, "SELECT 1", name="postgres") == ["1"]


def ask(database, port, question, name=NAME, timeout_s=10):
    """Lines of the answer, columns apart by "|"; None: it did not come."""
    password = pathlib.Path(database["password_file"]).read_text().strip()
    command = ["psql", "--no-psqlrc", "--quiet", "--tuples-only", "--no-align", "--set", "ON_ERROR_STOP=1", "--host", processes.HOST, "--port", str(port),
               "--username", USER, "--dbname", name, "--command", question]
    try:
        done = subprocess.run(command, env=os.environ | {"PGPASSWORD": password, "PGCONNECT_TIMEOUT": "3"}, capture_output=True, text=True,
                              check=False, stdin=subprocess.DEVNULL, timeout=timeout_s)
    except subprocess.TimeoutExpired:
        return None
    return done.stdout.splitlines() if done.returncode == 0 else None


def address(port):
    """What --store is given; the password stands in a file."""
    return f"postgresql://{USER}@{processes.HOST}:{port}/{NAME}"


def remove(database):
    """Only what make() made."""
    data = pathlib.Path(database["data"])
    if data.name == "postgresql" or (data.parent == pathlib.Path(OUTSIDE) and data.name.startswith("tissueform-cluster-")):
        shutil.rmtree(data, ignore_errors=True)
