#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""How far a cluster goes, on paper: the tables of docs/scaling.md, from what was measured on one, two and three servers.

    docs/scaling_model.py [--figures docs/results/cluster_load.json] [--planners 1000] [--followers 10000] [--check docs/scaling.md]

Reads figures of tests/scripts/measure_cluster.py. What was not measured there is a constant below, with where it is from. --check: exit code 1 where
the document does not hold the tables as they are printed.

The queue of a server. A drag sends at a steady rate, and a frame takes nearly the same time each; drags are in phase with nobody. So it is N periodic streams
of constant jobs before c cores (the ΣD/D/1 queue of packet networks), taken as one server c times as fast. With utilisation r and jobs of D seconds,
    P(wait > x D) ~ exp(-2 x (x / N + 1 - r))                (Roberts and Virtamo's heavy-traffic approximation)
from which the 99th percentile follows. Erlang's C (M/M/c) is shown beside it: what it would be if hands were dice.
"""

import argparse
import json
import math
import pathlib
import statistics
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]

# What people do: assumptions.
RATE = 60             # poses a second of a hand that moves
FOLLOW_RATE = 30      # frames a second that a follower takes
MOVING = 0.3          # the part of a planner's time in which the hand moves
COMMIT_S = 4          # of moving, between two commits
SESSION_S = 1800      # that a planner works on one head
LATE_S = 0.008        # half the interval: what waiting and answering may take, 99 of 100 times
# A machine.
CORES, MEMORY_GIB, GBIT = 8, 32, 10
# docs/performance.md: vertices of the bundled head's skin and of the part that a planner's page asks for; what int16 leaves of float32;
# the columns of three segments at these vertices.
SKIN, PAGE = 15828, 5171
INT16 = 48051 / 189936
COLUMN_BYTES = 1.24e6
REST_RATE = 1         # with columns a page needs a frame now and then, to confirm
# docs/scaling.md: commits a second of PostgreSQL with the log synced, 32 connections.
DATABASE_COMMITS = 4670
RENEWAL_S = 3          # leases; the table of nodes is written every second
PROXY_CONNECTIONS = 8000  # deploy/haproxy/cluster.cfg, maxconn
PASSES = 2            # of a page's call through HAProxy: to a gateway, and from there to a server
STREAMS, WATCHES = 512, 2048  # of a server: deploy/kubernetes/server.yaml
SOCKETS = 2048        # of a gateway: docs/gateway.md, --max-sockets
BUDGET = 0.75         # of a machine's memory (deploy/kubernetes)
# Of what a frame costs a server this part does not shrink with its bytes: messages, acknowledgements, waking up. An assumption.
FIXED = 0.5


def wait_p99(streams, utilisation, seconds, cores=1):
    """Seconds that 99 of 100 jobs wait at most."""
    # 2 x (x / N + 1 - r) = ln 100
    a, b, c = 2 / streams, 2 * (1 - utilisation), -math.log(100)
    return (-b + math.sqrt(b * b - 4 * a * c)) / (2 * a) * seconds / cores


def erlang_wait_p99(utilisation, seconds, cores):
    """The same of M/M/c."""
    offered = utilisation * cores
    blocked = 1.0
    for k in range(1, cores + 1):
        blocked = offered * blocked / (k + offered * blocked)
    waits = blocked / (1 - utilisation * (1 - blocked))
    return max(0.0, math.log(100 * waits)) * seconds / (cores * (1 - utilisation))


def most_streams(seconds, rate, cores):
    """Drags that a server carries with 99 of 100 frames there in time."""
    streams = int(cores / (seconds * rate))
    while streams > 1 and (streams * seconds * rate >= 0.99 * cores or wait_p99(streams, streams * seconds * rate / cores, seconds, cores) + seconds > LATE_S):
        streams -= 1
    return streams


def cost(seconds, part):
    """Of a frame with this part of the bytes."""
    return seconds * (FIXED + (1 - FIXED) * part)


class Figures:
    """What was measured, as costs."""

    def __init__(self, measured):
        self.runs = measured["runs"]
        self.measured = measured
        saturated = {nodes: self._median("saturated", "frames_per_second", nodes) for nodes in (1, 2, 3)}
        self.carried = saturated
        # X(N) = N X(1) / (1 + s (N - 1)): least squares for s.
        slopes = [(nodes * saturated[1] / saturated[nodes] - 1, nodes - 1) for nodes in (2, 3)]
        self.contention = max(0.0, sum(lost * others for lost, others in slopes) / sum(others * others for _, others in slopes))
        self.wall_s = 1 / saturated[1]  # with a share of a core
        self.frame_s = {"int16": 1 / self._one("whole core")["frames_per_second"], "float32": self._median("whole frames", "node_seconds_per_frame")}
        followed, alone = self._one("followers"), self._one("no followers")
        self.watch_s = max(0.0, followed["busy"]["node1"] - alone["busy"]["node1"]) / followed["watch_frames_per_second"]
        proxied = self._one("whole frames")
        self.proxy_s_per_byte = proxied["busy"]["haproxy"] / (proxied["frames_per_second"] * proxied["bytes_per_frame"])
        self.commits = self._one("commits")["commits_per_second"]
        memory = measured["memory"]
        self.session_gib = memory["session_mib"] / 1024
        self.shared_session_mib = memory["shared_session_mib"]

    def sessions_per_gib(self):
        return 1 / self.session_gib, 1024 / self.shared_session_mib

    def _of(self, kind, nodes=None):
        return [run for run in self.runs if run["kind"] == kind and nodes in (None, run["nodes"])]

    def _one(self, kind):
        return self._of(kind)[0]

    def _median(self, kind, field, nodes=None):
        return statistics.median(run[field] for run in self._of(kind, nodes))

    def at_ease(self, nodes):
        """Drags, and the 99th percentile of the latency, where seven tenths were asked for."""
        runs = self._of("at ease", nodes)
        worst = [max(node["latency_ms"]["p99"] for node in run["load"]["nodes"]) for run in runs]
        return round(statistics.median(run["load"]["sessions"] for run in runs)), statistics.median(worst)

    def latency_alone_ms(self):
        return self._one("one drag")["load"]["nodes"][0]["latency_ms"]["p50"]


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def number(value):
    return f"{value:,.0f}" if value >= 10 else f"{value:.1f}"


def measured_table(figures):
    rows = []
    for nodes in (1, 2, 3):
        modelled = nodes * figures.carried[1] / (1 + figures.contention * (nodes - 1))
        drags, p99 = figures.at_ease(nodes)
        # HAProxy's hash gives one of them more than its share: about a standard deviation of the binomial.
        share = drags / nodes + (math.sqrt(drags * (1 - 1 / nodes) / nodes) if nodes > 1 else 0)
        utilisation = min(0.98, share * RATE * figures.wall_s)
        wait = wait_p99(max(1, share), utilisation, figures.wall_s) * 1e3
        dice = erlang_wait_p99(utilisation, figures.wall_s, 1) * 1e3
        rows.append((str(nodes), number(figures.carried[nodes]), f"{figures.carried[nodes] / figures.carried[1]:.2f}", number(modelled), str(drags), f"{p99:.1f}",
                     f"{figures.latency_alone_ms() + wait:.1f}", f"{figures.latency_alone_ms() + dice:.1f}"))
    return table((f"servers, {figures.measured['share']:g} of a core each", "frames/s carried", "to one", "model", "drags at seven tenths", "latency p99, ms", "model", "M/M/1"), rows)


def costs_table(figures):
    rows = [("frames a core and second, whole skin, int16", number(1 / figures.frame_s["int16"])), ("float32, which is not packed", number(1 / figures.frame_s["float32"])),
            ("frames of followers a core and second, int16", number(1 / figures.watch_s)), ("Gbit/s that a core of HAProxy passes on", number(8e-9 / figures.proxy_s_per_byte)),
            ("commits a second that one server with a whole core made durable, each with a frame", number(figures.commits)),
            ("MiB of a session of the bundled head that shares nothing; sessions a GiB", f"{figures.session_gib * 1024:.0f}; {figures.sessions_per_gib()[0]:.1f}"),
            ("MiB of one that shares its preparation; sessions a GiB", f"{figures.shared_session_mib:.1f}; {number(figures.sessions_per_gib()[1])}")]
    return table(("measured", ""), rows)


def ways(figures):
    """What is sent for a hand that moves: seconds of a core a frame, bytes a frame, frames a second, and bytes once."""
    page = PAGE / SKIN
    for vertices, part in (("whole skin", 1.0), ("a page's vertices", page)):
        for encoding, shrunk in (("float32", 1.0), ("int16", INT16)):
            yield f"{vertices}, {encoding}", cost(figures.frame_s[encoding], part), 12 * SKIN * part * shrunk, RATE, 0.0
    yield "columns in the page", cost(figures.frame_s["int16"], page), 12 * PAGE * INT16, REST_RATE, COLUMN_BYTES


def demand(figures, way, planners, followers, moving):
    """What so many people take of everything, with this part of the hands moving."""
    _, seconds, bytes_a_frame, rate, once = way
    drags = planners * moving
    # Followers of a page that needs no frames are sent what the server makes for them.
    watched = followers * moving * FOLLOW_RATE
    made = drags * (max(rate, FOLLOW_RATE) if followers else rate)
    cores = made * seconds + watched * cost(figures.watch_s, bytes_a_frame / (12 * SKIN * INT16))
    bits = 8 * ((drags * rate + watched) * bytes_a_frame + planners * once / SESSION_S)
    carried = most_streams(seconds, max(rate, FOLLOW_RATE), CORES) * max(rate, FOLLOW_RATE) * seconds
    nodes = math.ceil(cores / carried)
    memory_nodes = math.ceil(planners * figures.session_gib / (MEMORY_GIB * BUDGET))
    return {"frames": drags * rate + watched, "gbit": bits / 1e9, "cores": cores, "nodes": max(nodes, memory_nodes) + 1, "by": "memory" if memory_nodes > nodes else "cores",
            "proxies": math.ceil(PASSES * max(bits / 1e9 / (0.7 * GBIT), bits / 8 * figures.proxy_s_per_byte / (0.7 * CORES), (planners + followers) / PROXY_CONNECTIONS)) + 1,
            "writes": writes(planners, moving, max(nodes, memory_nodes) + 1)}


def writes(planners, moving, nodes):
    """Transactions a second of the database (of a session four: made, taken, used, ended), and rows that the renewals write."""
    return planners * moving / COMMIT_S + nodes * (1 + 1 / RENEWAL_S) + 4 * planners / SESSION_S, planners / RENEWAL_S


def carried_table(figures, planners, followers):
    rows = []
    for label, people, moving in ((f"{planners:,} planners, every hand moves", 0, 1.0), (f"and {followers:,} followers", followers, 1.0),
                                  (f"the same, {MOVING:.0%} of the hands move", followers, MOVING)):
        for way in ways(figures):
            if way[0] == "a page's vertices, float32":
                continue  # One row less to read; ways() has it.
            need = demand(figures, way, planners, people, moving)
            rows.append((label, way[0], number(need["frames"]), number(need["gbit"]), number(need["cores"]), f"{need['nodes']} ({need['by']})", str(need["proxies"]),
                         number(need["writes"][0])))
            label = ""
    return table(("who", "what a hand is sent", "frames/s", "Gbit/s", "cores", f"servers of {CORES} cores, {MEMORY_GIB} GiB", f"HAProxys of {GBIT} Gbit/s", "database, writes/s"), rows)


def limits(figures, nodes=3, proxies=2, gateways=2):
    """How many planners, each with ten followers and 30 % of the hands moving, until something of a small cluster is full."""
    followers = 10
    way = list(ways(figures))[3]
    need = demand(figures, way, 1000, 1000 * followers, MOVING)
    carried = most_streams(way[1], RATE, CORES) * RATE * way[1]
    parts = {f"processors of {nodes} servers": nodes * carried / (need["cores"] / 1000),
             f"memory of {nodes} servers, a head each": nodes * MEMORY_GIB * BUDGET / figures.session_gib,
             f"network of {proxies} HAProxys": proxies * 0.7 * GBIT / (PASSES * need["gbit"] / 1000),
             f"processors of {proxies} HAProxys": proxies * 0.7 * CORES / (PASSES * need["gbit"] * 1e9 / 8 * figures.proxy_s_per_byte / 1000),
             f"connections of {proxies} HAProxys": proxies * PROXY_CONNECTIONS / (PASSES * (1 + followers)),
             f"drags open on {nodes} servers, `--max-streams {STREAMS}`": nodes * STREAMS,
             f"watches open on {nodes} servers, `--max-watches {WATCHES}`": nodes * WATCHES / followers,
             f"sockets of {gateways} gateways, `--max-sockets {SOCKETS}`": gateways * SOCKETS / (1 + followers),
             "commits of the database": DATABASE_COMMITS / (writes(1000, MOVING, nodes)[0] / 1000),
             "leases, rows the database renews": DATABASE_COMMITS / (writes(1000, MOVING, nodes)[1] / 1000)}
    rows = [(part, number(planners)) for part, planners in sorted(parts.items(), key=lambda each: each[1])]
    return table(("what is full", "at so many planners"), rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figures", type=pathlib.Path, default=ROOT / "docs/results/cluster_load.json")
    parser.add_argument("--planners", type=int, default=1000)
    parser.add_argument("--followers", type=int, default=10000)
    parser.add_argument("--check", type=pathlib.Path)
    options = parser.parse_args()
    figures = Figures(json.loads(options.figures.read_text()))
    tables = {"Measured, and modelled": measured_table(figures), "What things cost": costs_table(figures),
              "Carried further": carried_table(figures, options.planners, options.followers),
              "What gives in first": limits(figures)}
    if options.check:
        document = options.check.read_text()
        missing = [name for name, text in tables.items() if text not in document]
        print("\n".join(f"{options.check} does not hold the table: {name}" for name in missing) or "ok")
        return 1 if missing else 0
    for name, text in tables.items():
        print(f"{name}\n\n{text}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
