#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A cluster of its own under load, of which parts are killed, stopped, cut off and drained at random: what clients were told must be so.

Drags with commits, a session that all servers are asked for at once, followers, a page's socket and calls, and clients that make and delete meshes, sessions and
predictions: all by python3-grpcio. Exit code 0: nothing acknowledged was lost, no two servers answered for one session, and every drag
went on in time. 1: something was not so. 77: PostgreSQL, HAProxy or python3-grpcio is missing.
"""

import argparse
import itertools
import os
import pathlib
import random
import shutil
import signal
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
for folder in ("deploy/cluster", "tests/integration"):
    sys.path.append(str(ROOT / folder))
SKIPPED = 77
os.environ.setdefault("GRPC_VERBOSITY", "NONE")  # a proxy's own errors are no gRPC, of which its log would report each

import stack  # noqa: E402 (after the paths)

try:
    import grpc  # noqa: F401
    import google.protobuf  # noqa: F401
    import websockets  # noqa: F401
except ImportError as missing:
    print(f"{missing}; install it: apt-get install python3-grpcio python3-protobuf python3-websockets")
    sys.exit(SKIPPED)

import arena as arena_module  # noqa: E402
import browsers  # noqa: E402
import drags  # noqa: E402
import ledger as ledger_module  # noqa: E402
import maker  # noqa: E402
import our_clients  # noqa: E402
import scenarios  # noqa: E402
import stranger  # noqa: E402

SCENARIOS = ["kills", "stop", "split", "drain", "restart", "gone"]


def at_least(least, kind):
    """A number of an option."""
    def number(text):
        value = kind(text)
        if not least <= value < float("inf"):
            raise argparse.ArgumentTypeError(f"{text} is not at least {least}")
        return value
    number.__name__ = kind.__name__
    return number


def parse():
    parser = argparse.ArgumentParser(prog="deploy/cluster.sh chaos", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--kills", type=at_least(0, int), default=20, help="kill -9 of servers, gateways and HAProxy (default: 20)")
    parser.add_argument("--seconds", type=at_least(1, float), help="over how long (default: 2 for each kill)")
    parser.add_argument("--seed", type=int, help="of everything that is left to chance; the seed of a run that failed repeats what it did")
    parser.add_argument("--drags", type=at_least(2, int), default=6)
    parser.add_argument("--nodes", type=int, default=3, choices=range(1, 6))
    parser.add_argument("--gone", type=at_least(1, float), default=60, metavar="SECONDS", help="how long PostgreSQL is away in `gone` (default: 60)")
    parser.add_argument("--only", nargs="+", choices=SCENARIOS, default=SCENARIOS, help="scenarios, of all that there are")
    parser.add_argument("--state", default=ROOT / "build/cluster-chaos", metavar="FOLDER", help="where logs stand (default: build/cluster-chaos)")
    parser.add_argument("--keep-logs", action="store_true", help="leave the logs there at the end; they stay when something was not so")
    return parser.parse_args()


class Load:
    """Who uses the cluster meanwhile."""

    def __init__(self, arena, ledger, count, chance):
        self.arena, self.ledger = arena, ledger
        first = maker.Maker(arena.address, ledger, chance)
        mesh, handle_rest = first.new_mesh()
        sessions = [first.new_session(mesh) for _ in range(count)]
        self.contested = first.new_session(mesh)
        self.drags = [drags.Drag(arena.address, session, handle_rest, ledger) for session in sessions]
        # One of them is a page's.
        self.page = self.drags[-1] = browsers.SocketDrag(arena.cluster.address("browsers"), sessions[-1], handle_rest, ledger)
        self.web_reader = browsers.WebReader(arena.cluster.address("browsers"), sessions, ledger)
        numbers = itertools.count(1)
        places = [(node, arena.cluster.address(node)) for node in arena.cluster.nodes]
        places.append((arena_module.TWIN_OF, f"{stack.processes.HOST}:{arena.twin_port}"))
        self.rivals = [drags.Drag(address, self.contested, handle_rest, ledger, node=node, sequences=numbers) for node, address in places]
        self.followers = [drags.Follower(arena.address, session, ledger) for session in sessions[:2]]
        self.churns = [maker.Churn(arena.address, ledger, chance.random()) for _ in range(2)]
        self.preparation_s = 0.0
        self.reader = first

    def start(self):
        """Every drag shows a frame; the longest time from a stream's begin to that is what a preparation takes here."""
        begin = time.monotonic()
        for each in self.drags:
            each.start()
        while any(each.last_frame is None for each in self.drags):
            if time.monotonic() > begin + 60:
                raise SystemExit(f"not every drag shows a frame: {dict(self.ledger.ends)} {self.ledger.violations}")
            time.sleep(0.05)
        self.preparation_s = max(each.stream.first_frame_at - each.stream.begun_at for each in self.drags)
        print(f"all drags show frames after {time.monotonic() - begin:.2f} s: {dict(self.ledger.ends)}", flush=True)
        for each in (*self.rivals, *self.followers, *self.churns, self.web_reader):
            each.start()

    def stop(self):
        everybody = (self.web_reader, *self.churns, *self.followers, *self.rivals, *self.drags)
        for each in everybody:
            each.stop()
        for each in everybody:
            if each.is_alive():
                each.join(30)

    def kept_sequence(self, session):
        poses = self.reader.session_state(session).committed_poses
        return int(poses[0].pivot_mm.x) if poses else 0


def judge_gaps(arena, ledger, load, began):
    """Every time for which a drag showed nothing, against what was done to the cluster meanwhile."""
    for session, begin, end, before, after in ledger.gaps:
        if session == load.contested:  # its drags stay with servers that are killed
            continue
        until = arena.may_rest_until(session, begin, end, load.preparation_s)
        if end > until:
            done = [event.what for event in arena.events if begin - 1 <= event.at <= end]
            ledger.violation(f"the drag of {session} showed nothing from {begin - began:.2f} to {end - began:.2f} s, {end - until:.2f} s too long; "
                             f"from {before} to {after}; {done}")


def print_gaps(ledger, load):
    moved = sorted(end - begin for session, begin, end, _, _ in ledger.gaps if session != load.contested)
    if not moved:
        print(f"gaps of more than {ledger_module.GAP_S} s: none")
        return
    at = lambda share: moved[min(len(moved) - 1, int(share * len(moved)))]
    print(f"gaps of more than {ledger_module.GAP_S} s: {len(moved)}, p50 {at(0.5):.2f} s, p99 {at(0.99):.2f} s, longest {moved[-1]:.2f} s; "
          f"a preparation takes {load.preparation_s:.2f} s here")
    print(" ".join(f"{gap:.2f}" for gap in moved))


def run_scenarios(options, arena, load, ledger, seed):
    run = scenarios.Scenarios(arena, load, ledger, seed)
    if "kills" in options.only:
        seconds = options.seconds or 2 * options.kills
        ours = our_clients.OurClients(arena, seconds + 3)
        try:
            run.kills(options.kills, seconds)
            run.settle()
            run.say(f"tissueform load: {ours.judge(ledger)}")
        finally:
            ours.stop()
    if "stop" in options.only or "split" in options.only:
        run.stop_and_split("stop" in options.only, "split" in options.only)
        run.settle()
    if "drain" in options.only:
        run.drain()
        run.settle()
    if "restart" in options.only:
        run.restart_database()
        run.settle()
    if "gone" in options.only:
        run.database_gone(options.gone)
        run.settle()
    return run


def chaos(options, seed):
    chance, ledger = random.Random(seed), ledger_module.Ledger()
    print(f"seed {seed}: deploy/cluster.sh chaos --kills {options.kills} --seed {seed}", flush=True)
    arena = arena_module.Arena(options.state, options.programs, options.nodes)
    stranger.import_protocol(ROOT / "proto")
    load = None
    try:
        arena.up()
        load = Load(arena, ledger, options.drags, chance)
        load.start()
        run = run_scenarios(options, arena, load, ledger, chance.random())
        load.stop()
        run.say("all that was acknowledged is read back, through one server after the other")
        maker.read_back([maker.Maker(arena.cluster.address(node), ledger, chance) for node in arena.cluster.nodes], ledger)
        judge_gaps(arena, ledger, load, run.begin)
        report(ledger, load, run)
    finally:
        if load is not None:
            load.stop()
        if ledger.violations or options.keep_logs:
            keep = arena.cluster.folder.with_name(arena.cluster.folder.name + "-logs")
            shutil.rmtree(keep, ignore_errors=True)
            shutil.copytree(arena.cluster.folder, keep, ignore=lambda folder, names: [name for name in names if not name.endswith(".log")])
            print(f"logs: {keep}")
        arena.down()
    return 1 if ledger.violations else 0


def report(ledger, load, run):
    counts = ledger.counts
    print(f"killed: {', '.join(f'{run.victims.count(name)} x {name}' for name in sorted(set(run.victims))) or 'nothing'}")
    print(f"acknowledged and read back: {counts['meshes']} meshes, {counts['sessions']} sessions, {counts['deletions']} deletions, "
          f"{counts['predictions']} predictions, {counts['commits']} commits; {counts['frames']} frames, {counts['gRPC-Web answers']} answers by gRPC-Web")
    print(f"followers: {', '.join(str(each.frames) for each in load.followers)} frames; streams of the drags: {', '.join(str(each.streams) for each in load.drags)}")
    print(f"streams ended: {dict(ledger.ends)}; commits that were refused: {dict(ledger.refused_commits)}")
    print_gaps(ledger, load)
    print(f"violations: {len(ledger.violations)}")


def end_once(*_):
    """For SIGTERM, which timeout(1) sends twice: the second one must not end the ending."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    sys.exit(128 + signal.SIGTERM)


def main():
    options = parse()
    missing = arena_module.missing_programs()
    if shutil.which("protoc") is None:
        missing.append("protoc is missing; install it: apt-get install protobuf-compiler")
    if missing:
        print("\n".join(missing))
        sys.exit(SKIPPED)
    seed = options.seed if options.seed is not None else random.SystemRandom().randrange(10**6)
    # A signal that ends this also ends what it has started.
    signal.signal(signal.SIGTERM, end_once)
    sys.exit(chaos(options, seed))


if __name__ == "__main__":
    main()
