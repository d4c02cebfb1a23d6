# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A cluster on loopback: what belongs to it, where it listens, and how each of its programs is started and ended.

All that a later run must know stands in state.json of a folder: ports, process ids, where the database lies.
"""

import json
import os
import pathlib
import shutil
import signal
import sys

import balancer
import database
import processes

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1]))
from folders import make_folder
from free_ports import check_free, free_ports

DATABASE, HAPROXY = "postgresql", balancer.NAME
ROOT = processes.ROOT
# Servers that there may be. HAProxy knows them all from the start, so that one is added by being started. As many as a database
# of PostgreSQL's default of 100 connections takes.
MOST_NODES = 5
PORTS_OF_HAPROXY = ("workstations", "browsers", "calls_of_gateways")
SETTINGS = {"nodes": 3, "gateways": 2, "cpus": [], "server_options": [], "server_environment": {}, "database_ports": {}}


def missing_programs():
    """Lines, one for each program of others that is not installed: what it is and its package."""
    lines = []
    if shutil.which("haproxy", path=processes.SYSTEM_PATH) is None:
        lines.append("haproxy is missing; install it: apt-get install haproxy")
    if database.program("initdb") is None or shutil.which("psql") is None:
        lines.append("PostgreSQL is missing; install it: apt-get install postgresql")
    if shutil.which("taskset") is None:
        lines.append("taskset is missing; install it: apt-get install util-linux")
    return lines


class Cluster:
    """One cluster by its state folder."""

    def __init__(self, folder, programs, web=None):
        self.folder, self.programs = pathlib.Path(folder).absolute(), pathlib.Path(programs).absolute()
        self.web = pathlib.Path(web) if web is not None and pathlib.Path(web, "index.html").exists() else None
        self.state = {}
        if self.state_file.exists():
            self.state = json.loads(self.state_file.read_text())

    @property
    def state_file(self):
        return self.folder / "state.json"

    @property
    def exists(self):
        return bool(self.state)

    def save(self):
        written = self.folder / "state.json.new"
        written.write_text(json.dumps(self.state, indent=2) + "\n")
        written.rename(self.state_file)

    def log(self, name):
        return self.folder / f"{name}.log"

    # Names

    @property
    def nodes(self):
        return self.places[:self.state["settings"]["nodes"]]

    @property
    def places(self):
        """Names of the servers that there are, and of those that may be added."""
        return [f"node{number}" for number in range(1, MOST_NODES + 1)]

    @property
    def gateways(self):
        return [f"gateway{number}" for number in range(1, self.state["settings"]["gateways"] + 1)]

    @property
    def names(self):
        return [DATABASE, *self.nodes, HAPROXY, *self.gateways]

    def port(self, name):
        return self.state["ports"][name]

    def ports_of(self, name):
        """All on which the program of that name listens."""
        return [self.port(each) for each in (PORTS_OF_HAPROXY if name == HAPROXY else (name,))]

    def address(self, name):
        return f"{processes.HOST}:{self.port(name)}"

    def process(self, name):
        return self.state["processes"].get(name)

    def is_running(self, name):
        return processes.is_running(self.process(name))

    # What is made once

    def make(self, **settings):
        """The folder, the ports and the files of the database."""
        make_folder(self.folder, "--state", mode=0o700)
        self.folder.chmod(0o700)
        self.state = {"settings": SETTINGS | settings, "processes": {}, "ports": {}}
        listening = [*self.names, *self.places[len(self.nodes):], *PORTS_OF_HAPROXY]
        self.state["ports"] = dict(zip(listening, free_ports(len(listening))))
        self.state["database"] = database.make(self.folder)
        self.save()

    # Commands

    def cpus_of(self, node):
        cpus = self.state["settings"]["cpus"]
        return cpus[self.nodes.index(node) % len(cpus)] if cpus else None

    def server_command(self, node):
        settings = self.state["settings"]
        # A test may put a proxy of its own between a node and the database.
        database_port = settings["database_ports"].get(node, self.port(DATABASE))
        workers = ["--workers", str(self._count(self.cpus_of(node)))] if self.cpus_of(node) else []
        return [self.programs / "tissueform-server", "--port", str(self.port(node)), "--node-name", node, "--store", database.address(database_port),
                "--store-password-file", self.state["database"]["password_file"], "--memory-budget-mib", str(self._memory_mib()),
                # All clients come from one address, HAProxy's, without a login: all are one principal.
                "--max-connections-per-address", "1024", "--quota-streams", "2048", "--quota-calls-per-second", "20000",
                *workers, *settings["server_options"]]

    @staticmethod
    def _count(cpus):
        ends = [[int(end) for end in part.split("-")] for part in cpus.split(",")]
        return sum(end[-1] - end[0] + 1 for end in ends)

    def _memory_mib(self):
        """The nodes share half of the machine's memory, as one server would take."""
        machine_mib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20
        return max(256, machine_mib // 2 // self.state["settings"]["nodes"])

    def gateway_command(self, gateway):
        web = ["--web", self.web] if self.web else []
        return [self.programs / "tissueform-gateway", "--listen", self.address(gateway), "--server", self.address("calls_of_gateways"),
                "--calls-per-channel", "1", "--channels-per-server", "2400", *web,
                "--max-connections-per-address", "4096", "--trust-forwarded-from", processes.HOST]

    # Starting and ending

    def start(self, name):
        """Starts one of the cluster's programs where it does not run, and does not wait for it (but for the database)."""
        if self.is_running(name):
            return
        for port in self.ports_of(name):
            check_free(port, name, "end what listens there, or have other ports: `deploy/cluster.sh down`, then `up`")
        if name == DATABASE:
            process = self._start_database()
        elif name == HAPROXY:
            process = balancer.start(self)
        elif name in self.nodes:
            process = processes.start(self.server_command(name), self.log(name), cpus=self.cpus_of(name),
                                      environment=self.state["settings"]["server_environment"].get(name))
        else:
            process = processes.start(self.gateway_command(name), self.log(name))
        self.state["processes"][name] = process
        self.save()

    def _start_database(self):
        files = self.state["database"]
        if not files["made"]:
            database.initialise(files, self.log(DATABASE))
        process = database.start(files, self.port(DATABASE), self.log(DATABASE))
        if not files["made"]:
            if database.ask(files, self.port(DATABASE), f"CREATE DATABASE {database.NAME}", name="postgres") is None:
                database.stop(process)
                raise SystemExit(f"the database could not be made; see {self.log(DATABASE)}")
            files["made"] = True
        return process

    def wait_until_ready(self, name):
        processes.wait_for(name, lambda: processes.accepts(self.port(name)), self.process(name), self.log(name))

    def up(self):
        """Starts what does not run; those that run are left alone."""
        for name in self.names:
            self.start(name)
        for name in (*self.nodes, *self.gateways):
            self.wait_until_ready(name)
        balancer.wait_until_routing(self)

    def add(self):
        """Starts the next server without notifying the others; its name."""
        self.state["settings"]["nodes"] += 1
        name = self.nodes[-1]
        self.start(name)
        self.wait_until_ready(name)
        balancer.wait_until_routing(self)
        return name

    def kill(self, name, how=signal.SIGKILL):
        processes.send(self.process(name), how)

    def stop(self, name):
        if name == DATABASE:
            database.stop(self.process(name))
        else:
            processes.stop(self.process(name))
        self.state["processes"].pop(name, None)
        self.save()

    def down(self):
        """Ends what was started, the last first, and removes the folder."""
        for name in self.names:
            if name in (*self.nodes, *self.gateways):
                processes.send(self.process(name), signal.SIGTERM)
        for name in reversed(self.names):
            if self.process(name) is not None:
                self.stop(name)
        database.remove(self.state["database"])
        shutil.rmtree(self.folder)
        self.state = {}

    def ask_database(self, question, timeout_s=10):
        return database.ask(self.state["database"], self.port(DATABASE), question, timeout_s=timeout_s)
