# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A cluster under load whose parts are ended: the processes, what was done to them and when, and how long a drag may rest for it."""

import dataclasses
import glob
import shutil
import signal
import threading
import time

import balancer
import processes
import stack
from free_ports import free_ports

LEASE_S = 10
AFTER_S = 1
TWIN, SHIFTED, TWIN_OF = "twin", "node2", "node1"
CLOCK_OFF = "+1h"


@dataclasses.dataclass
class Event:
    """Something that was done to the cluster: when, and from when on it is as before."""
    at: float
    what: str
    held: set = dataclasses.field(default_factory=set)  # sessions of the server that it was done to
    stops_all: bool = False  # no client is answered until it is over
    seen_after_s: float = 0  # so much later proxies know
    back_at: float = None


def fake_clock():
    """The environment of a program whose wall clock is an hour off."""
    return {"LD_PRELOAD": _faketime()[0], "FAKETIME": CLOCK_OFF, "FAKETIME_DONT_FAKE_MONOTONIC": "1"}


def _faketime():
    return glob.glob("/usr/lib/*/faketime/libfaketime.so.1")


def missing_programs():
    """As stack.missing_programs, of what the run needs besides."""
    return stack.missing_programs() + ([] if _faketime() else ["faketime is missing; install it: apt-get install faketime"])


class Arena:
    """The cluster. Between each server and the database lies a link of its own, which can be frozen: HAProxy as a plain TCP proxy. One
    server has a clock that is an hour off, and another one a twin of the same name that HAProxy does not know."""

    def __init__(self, folder, programs, nodes):
        self.cluster = stack.Cluster(folder, programs)
        if self.cluster.exists:
            self.cluster.down()
        names = [f"node{number}" for number in range(1, nodes + 1)]
        ports = dict(zip([*names, TWIN], free_ports(nodes + 1)))
        self.cluster.make(nodes=nodes, database_ports={name: ports[name] for name in names}, server_environment={SHIFTED: fake_clock()})
        self.links, self.twin = {}, None
        self.twin_port = ports[TWIN]
        self.events, self.lock, self.starting = [], threading.Lock(), threading.Lock()

    @property
    def address(self):
        return self.cluster.address("workstations")

    def up(self):
        self.cluster.start(stack.DATABASE)
        for node, port in self.cluster.state["settings"]["database_ports"].items():
            self._start_link(node, port)
        self.cluster.up()
        command = [str(word) for word in self.cluster.server_command(TWIN_OF)]
        command[command.index("--port") + 1] = str(self.twin_port)
        self.twin = processes.start(command, self.cluster.log(TWIN))
        processes.wait_for(TWIN, lambda: processes.accepts(self.twin_port), self.twin, self.cluster.log(TWIN))

    def _start_link(self, node, port):
        file = self.cluster.folder / f"link_{node}.cfg"
        file.write_text(f"defaults\n  mode tcp\n  timeout connect 5s\n  timeout client 1h\n  timeout server 1h\nlisten {node}\n"
                        f"  bind {processes.HOST}:{port}\n  server database {self.cluster.address(stack.DATABASE)}\n")
        self.links[node] = processes.start([shutil.which("haproxy", path=processes.SYSTEM_PATH), "-db", "-f", file], self.cluster.log(f"link_{node}"))

    def down(self):
        if self.twin is not None:
            processes.send(self.twin, signal.SIGCONT)
            processes.send(self.twin, signal.SIGTERM)
        for link in self.links.values():
            processes.send(link, signal.SIGCONT)
        for name in self.cluster.names:
            processes.send(self.cluster.process(name), signal.SIGCONT)
        for node in (*self.cluster.nodes, *self.cluster.gateways):
            processes.send(self.cluster.process(node), signal.SIGTERM)
        if self.twin is not None:
            processes.stop(self.twin)
        for node in self.cluster.nodes:
            self.cluster.stop(node)
        for link in self.links.values():
            processes.stop(link, signal.SIGKILL)
        self.cluster.down()

    # Who holds what

    def holders(self):
        """Session (its name) to (node, epoch), of leases that have not run out; None: the database does not answer."""
        lines = self.cluster.ask_database("SELECT id, node, epoch FROM sessions JOIN session_states USING (key) WHERE lease_until > tissueform_now()")
        if lines is None:
            return None
        rows = [line.rsplit("|", 2) for line in lines]
        return {f"sessions/{name}": (node, int(epoch)) for name, node, epoch in rows}

    def held_by(self, node):
        return {session for session, (holder, _) in (self.holders() or {}).items() if holder == node}

    def epoch_of(self, session):
        """0: the database does not answer."""
        return int((self.cluster.ask_database(f"SELECT epoch FROM sessions JOIN session_states USING (key) WHERE id = '{session.removeprefix('sessions/')}'") or [0])[0])

    def name_at(self, address):
        """Which server listens there, of those of one name too."""
        return next((node for node in self.cluster.nodes if self.cluster.address(node) == address), TWIN)

    def process_at(self, address):
        name = self.name_at(address)
        return self.twin if name == TWIN else self.cluster.process(name)

    # What is done

    def note(self, what, held=(), **facts):
        event = Event(time.monotonic(), what, set(held), **facts)
        with self.lock:
            self.events.append(event)
        return event

    def kill(self, name):
        event = self.note(f"kill -9 {name}", stops_all=name == stack.HAPROXY)
        self.cluster.kill(name)
        processes.wait_until_gone(self.cluster.process(name))
        if name in self.cluster.nodes:
            event.held = self.held_by(name)
        return event

    def bring_back(self, name, event):
        with self.starting:
            self.cluster.start(name)
        if name == stack.HAPROXY:
            balancer.wait_until_routing(self.cluster, patience_s=20, needed=1)
        elif name != stack.DATABASE:
            self.cluster.wait_until_ready(name)
        event.back_at = time.monotonic()

    # How long a drag may rest

    def may_rest_until(self, session, begin, end, preparation_s):
        """Until when a drag that showed its last frame at `begin` may go without the next one."""
        base = begin
        with self.lock:
            events = [event for event in self.events if event.at <= end and (event.back_at or end) >= begin - AFTER_S]
        for event in events:
            if session in event.held:
                base = max(base, event.at + LEASE_S + event.seen_after_s)
            if event.stops_all:
                base = max(base, (event.back_at or end) + event.seen_after_s)
        return base + preparation_s + AFTER_S

