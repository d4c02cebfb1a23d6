#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Measures how many drags one, two and three servers behind one name carry: the figures of docs/scaling.md.

  tests/scripts/measure_cluster.py BUILD [--seconds S] [--turns N] [--share PART] [--json FILE]

Starts clusters by deploy/cluster on a machine of four cores. Clients have a core of their own, HAProxy and PostgreSQL together another one; these are
full when three servers are, each with a whole core. So each server has one worker and a share of a core (half: --share) on the other two, by a control
group of processors, version 1, which only root makes; whatever else the machine does comes after. One, three and two servers take turns. Each is asked
for more than it can answer, so that the frames that come are what it carries; then for seven tenths of that. A single one is measured once more with a
whole core, for whole frames, for followers, and for commits. Processor time is that of the processes, in the middle of a run. Prints a line a run, and
what three carry for each one that one carries.
"""

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "deploy/cluster"))
import stack  # noqa: E402

TICKS = os.sysconf("SC_CLK_TCK")
PAGE_MIB = os.sysconf("SC_PAGE_SIZE") / 2**20
SAMPLE_S = 0.25
GROUPS = pathlib.Path("/sys/fs/cgroup/cpu")
PERIOD_US = 4000
CLIENT_CORE, OTHERS_CORE = 2, 3
SLOW_START_S = 11
MANY = 150  # sessions at once; HAProxy lets an address have 200 connections
SERVER_OPTIONS = ["--max-streams", "4096", "--max-sessions", "4096", "--max-watches", "4096", "--quota-sessions", "4096", "--log-level", "warn"]


def family(pid):
    """A process and its children: PostgreSQL has one for each connection."""
    found = [pid]
    for task in pathlib.Path(f"/proc/{pid}/task").glob("*/children"):
        for child in task.read_text().split():
            found += family(int(child))
    return found


def processor_seconds(pid):
    total = 0
    for each in family(pid):
        try:
            fields = pathlib.Path(f"/proc/{each}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        total += int(fields[11]) + int(fields[12])
    return total / TICKS


def resident_mib(pid):
    return int(pathlib.Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE_MIB


class Group:
    """A control group: processes that have so much of a core together, before what else the machine does."""

    def __init__(self, name, share=None):
        self.folder = GROUPS / f"tissueform-{os.getpid()}-{name}"
        self.folder.mkdir()
        self._say("cpu.shares", 200_000)
        if share is not None:
            self._say("cpu.cfs_period_us", PERIOD_US)
            self._say("cpu.cfs_quota_us", int(share * PERIOD_US))

    def _say(self, name, value):
        (self.folder / name).write_text(str(value))

    def add(self, pid):
        for each in family(pid):
            self._say("cgroup.procs", each)

    def remove(self):
        """When its processes have ended."""
        for _ in range(100):
            try:
                return self.folder.rmdir()
            except OSError:
                time.sleep(0.05)


class Sampler(threading.Thread):
    """Processor seconds of some processes over time."""

    def __init__(self, pids):
        super().__init__(daemon=True)
        self.pids, self.samples, self.ended = pids, [], threading.Event()
        self.resident_mib = {name: 0 for name in pids}  # the most

    def run(self):
        while not self.ended.wait(SAMPLE_S):
            try:
                self.samples.append((time.monotonic(), {name: processor_seconds(pid) for name, pid in self.pids.items()}))
                self.resident_mib = {name: max(most, resident_mib(self.pids[name])) for name, most in self.resident_mib.items()}
            except OSError:
                pass

    def busy(self, begin, end):
        """Of each process the part of a core that it took between two times."""
        within = [sample for sample in self.samples if begin <= sample[0] <= end]
        (first, before), (last, after) = within[0], within[-1]
        return {name: (after[name] - before[name]) / (last - first) for name in before}


class Machine:
    """A cluster of so many servers with a share of a core each."""

    def __init__(self, options, folder, nodes, share):
        self.programs, self.folder, self.share = options.build.resolve() / "bin", folder, share
        self.cluster = stack.Cluster(folder / f"cluster{nodes}", self.programs)
        self.cluster.make(nodes=nodes, gateways=1, cpus=["0", "1"], server_options=SERVER_OPTIONS)
        self.groups = []

    def group(self, name, pid, share=None):
        self.groups.append(Group(f"{name}-{len(self.groups)}", share))
        self.groups[-1].add(pid)

    def __enter__(self):
        # What this process starts and does not pin runs where it does.
        os.sched_setaffinity(0, {OTHERS_CORE})
        self.cluster.up()
        # HAProxy lets a server begin slowly.
        time.sleep(SLOW_START_S)
        for name in (stack.HAPROXY, stack.DATABASE):
            self.group(name, self.cluster.process(name)["pid"])
        for node in self.cluster.nodes:
            self.group(node, self.cluster.process(node)["pid"], self.share)
        return self

    def __exit__(self, *_):
        self.cluster.down()
        for group in self.groups:
            group.remove()

    def load(self, kind, seconds, **options):
        """One run of `tissueform load --cluster`; what it says, with what the processes took."""
        pids = {name: self.cluster.process(name)["pid"] for name in (*self.cluster.nodes, stack.HAPROXY, stack.DATABASE)}
        file = self.folder / "load.json"
        words = [word for name, value in options.items() for word in (f"--{name.replace('_', '-')}", str(value))]
        transactions = self.transactions()
        begin = time.monotonic()
        client = subprocess.Popen(["taskset", "--cpu-list", str(CLIENT_CORE), self.programs / "tissueform", "load", "--cluster", "--server", self.cluster.address("workstations"), "--seconds", str(seconds),
                                   "--json", file, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.group("clients", client.pid)
        sampler = Sampler(pids | {"clients": client.pid})
        sampler.start()
        _, errors = client.communicate(timeout=seconds + 300)
        end = time.monotonic()
        sampler.ended.set()
        sampler.join()
        if client.returncode != 0:
            raise SystemExit(f"{kind} on {len(self.cluster.nodes)} servers: {errors[-500:]}")
        said = json.loads(file.read_text())
        # Deleting the sessions comes after the drags.
        quiet = 1 + 0.01 * said["sessions"]
        busy = sampler.busy(max(begin, end - quiet - 0.8 * seconds), end - quiet)
        frames = sum(node["frames"] for node in said["nodes"]) / seconds
        return {"kind": kind, "share": self.share, "resident_mib": sampler.resident_mib, "nodes": len(self.cluster.nodes), "frames_per_second": frames, "busy": busy,
                "node_seconds_per_frame": sum(busy[node] for node in self.cluster.nodes) / frames,
                "watch_frames_per_second": sum(node["watch_frames"] for node in said["nodes"]) / seconds,
                "commits_per_second": said["commits_acknowledged"] / seconds,
                "transactions_per_second": (self.transactions() - transactions) / (end - begin),
                "bytes_per_frame": sum(node["bytes"] for node in said["nodes"]) / max(1, sum(node["frames"] for node in said["nodes"])), "load": said}

    def transactions(self):
        lines = self.cluster.ask_database("SELECT xact_commit FROM pg_stat_database WHERE datname = current_database()")
        return int(lines[0]) if lines else 0

    def resident_mib(self):
        return resident_mib(self.cluster.process(self.cluster.nodes[0])["pid"])


def print_run(run):
    latency = next(node["latency_ms"] for node in run["load"]["nodes"])
    print(f"{run['kind']:<12} {run['nodes']} servers: {run['frames_per_second']:7.0f} frames/s, {1e3 * run['node_seconds_per_frame']:.3f} ms of a core a frame, "
          f"p50 {latency['p50']:.1f} p99 {latency['p99']:.1f} ms, {run['commits_per_second']:.0f} commits/s; clients {run['busy']['clients']:.2f} HAProxy "
          f"{run['busy'][stack.HAPROXY]:.2f} PostgreSQL {run['busy'][stack.DATABASE]:.2f} cores", flush=True)
    return run


def measure_turns(options, folder):
    runs = []
    for turn in range(options.turns):
        for nodes in (1, 3, 2):
            with Machine(options, folder / f"turn{turn}", nodes, options.share) as machine:
                runs.append(print_run(machine.load("saturated", options.seconds, sessions=round(64 * options.share) * nodes, rate=60, encoding="int16")))
                carried = runs[-1]["frames_per_second"]
                # Seven tenths of that, for how old frames are where there is room.
                runs.append(print_run(machine.load("at ease", options.seconds, sessions=max(1, int(0.7 * carried / 60)), rate=60, encoding="int16")))
    return runs


def measure_rest(options, folder):
    runs, seconds = [], options.seconds
    with Machine(options, folder, 1, 1.0) as machine:
        before = machine.resident_mib()
        first = machine.load("memory", 2, sessions=1, rate=10)
        many = machine.load("memory", 2, sessions=MANY, rate=2)
        sessions_mib = [run["resident_mib"][machine.cluster.nodes[0]] - before for run in (first, many)]
        # The first of a head is all of its preparation; the others share it.
        memory = {"idle_mib": before, "session_mib": sessions_mib[0], "shared_session_mib": (sessions_mib[1] - sessions_mib[0]) / (MANY - 1),
                  "prepared_seconds": first["load"]["preparing_seconds"], "prepared_many_seconds": many["load"]["preparing_seconds"]}
        runs.append(print_run(machine.load("whole core", seconds, sessions=45, rate=60, encoding="int16")))
        runs.append(print_run(machine.load("whole frames", seconds, sessions=40, rate=60)))
        runs.append(print_run(machine.load("one drag", seconds, sessions=1, rate=60, encoding="int16")))
        runs.append(print_run(machine.load("followers", seconds, sessions=4, followers=40, rate=30, encoding="int16")))
        runs.append(print_run(machine.load("no followers", seconds, sessions=4, rate=30, encoding="int16")))
        runs.append(print_run(machine.load("commits", seconds, sessions=64, rate=60, encoding="int16", commit_seconds=0.01)))
    return runs, memory


def carried(runs, nodes):
    return statistics.median(run["frames_per_second"] for run in runs if run["kind"] == "saturated" and run["nodes"] == nodes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=12)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--share", type=float, default=0.5, help="of a core, for each server")
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    missing = stack.missing_programs()
    if missing or os.cpu_count() < 4 or not os.access(GROUPS, os.W_OK):
        raise SystemExit("\n".join(missing) or f"four cores are needed, and root's right to make {GROUPS}/...")
    load_before = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as name:
        rest, memory = measure_rest(options, pathlib.Path(name) / "rest")
        runs = measure_turns(options, pathlib.Path(name))
    ratios = {nodes: carried(runs, nodes) / carried(runs, 1) for nodes in (2, 3)}
    print(f"two servers carry {ratios[2]:.2f} times what one carries, three {ratios[3]:.2f} times")
    print(f"sessions a GiB: {1024 / memory['session_mib']:.1f} that share nothing, {1024 / memory['shared_session_mib']:.0f} that share a preparation")
    said = runs[0]["load"]
    common = {name: said[name] for name in ("machine", "compiler", "commit", "notice")}
    for run in runs + rest:
        run["load"] = {name: value for name, value in run["load"].items() if name not in common}
    if options.json:
        options.json.write_text(json.dumps(common | {
            "load_average_before": load_before, "share": options.share, "turns": options.turns,
            "pinned": "servers one after the other to the cores 0 and 1 with one worker each, clients to 2, HAProxy and PostgreSQL to 3",
            "ratio_2_to_1": ratios[2], "ratio_3_to_1": ratios[3], "memory": memory, "runs": runs + rest}, indent=1) + "\n")


if __name__ == "__main__":
    main()
