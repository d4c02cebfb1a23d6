# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Several servers behind one name, on this machine: what deploy/cluster.sh does."""

import argparse
import fcntl
import os
import pathlib
import sys

import balancer
import processes
import stack

ROOT = stack.ROOT
EXAMPLES = """\
A cluster is PostgreSQL, which keeps everything and decides who holds a session; HAProxy, by which workstations and browsers
find it; servers (node1, node2, ...), each of which may end at any time; and two gateways for browsers. All listen on
127.0.0.1, on ports that are free when the cluster is made.

  deploy/cluster.sh up                        makes and starts it, or starts again what has ended
  deploy/cluster.sh up --nodes 2 --cpus 0 --cpus 1    two servers, each on a core of its own
  deploy/cluster.sh add                       one server more, which takes its part of the sessions
  deploy/cluster.sh status                    who runs, who holds which sessions, and what HAProxy thinks
  deploy/cluster.sh chaos --kills 20          a cluster of its own, killed at random under load; --help tells more
  deploy/cluster.sh down                      ends it; what it kept is gone

docs/scaling.md tells what there is to see.
"""


def parse(words):
    parser = argparse.ArgumentParser(prog="deploy/cluster.sh", description=__doc__, epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", help=argparse.SUPPRESS, required=True)
    parser.add_argument("--web", help=argparse.SUPPRESS)
    commands = parser.add_subparsers(dest="command", metavar="up|add|status|down|chaos", required=True)
    up = commands.add_parser("up", help="make and start it; start again what has ended")
    up.add_argument("--nodes", type=int, choices=range(1, stack.MOST_NODES + 1), default=3, help="servers (default: 3)")
    up.add_argument("--gateways", type=int, choices=range(1, 4), default=2, help="gateways (default: 2)")
    up.add_argument("--cpus", action="append", default=[], metavar="LIST",
                    help="pin a server to these cores, as taskset counts them; given several times: the first server to the first list, and so on")
    up.add_argument("--server-option", action="append", default=[], metavar="WORD",
                    help="a word more on each server's command line: --server-option=--workers --server-option=1")
    commands.add_parser("add", help="start one server more; nothing else is told or started again")
    commands.add_parser("status", help="who runs, who holds what, and what HAProxy thinks")
    commands.add_parser("down", help="end it, and remove what it kept")
    commands.add_parser("chaos", help="kill parts of a cluster of its own at random, under load")
    for each in commands.choices.values():
        each.add_argument("--state", default=ROOT / "build/cluster", metavar="FOLDER", help="where ports, process ids and logs stand (default: build/cluster)")
    return parser.parse_args(words)


def check_cpus(lists):
    for cpus in lists:
        try:
            stack.Cluster._count(cpus)
        except ValueError:
            raise SystemExit(f"--cpus {cpus}: a list of cores is meant, such as 0 or 0,1 or 0-3") from None


def up(cluster, options):
    missing = stack.missing_programs()
    if missing:
        raise SystemExit("\n".join(missing))
    check_cpus(options.cpus)
    if not cluster.exists:
        cluster.make(nodes=options.nodes, gateways=options.gateways, cpus=options.cpus, server_options=options.server_option)
    elif cluster.state["settings"]["nodes"] != options.nodes:
        print(f"there is a cluster of {len(cluster.nodes)} servers already; `deploy/cluster.sh down` ends it")
    cluster.up()
    print(f"""\
workstations  {cluster.address("workstations")}
browsers      http://{cluster.address("browsers")}/{"" if cluster.web else "   (no planner is built: deploy/build_web.sh)"}
servers       {", ".join(f"{node} {cluster.address(node)}" for node in cluster.nodes)}
logs          {cluster.folder}

Try: {cluster.programs}/tissueform load --server {cluster.address("workstations")} --sessions 6 --churn 1 --seconds 60
     deploy/cluster.sh status            which server holds them
     kill -9 {cluster.process(cluster.nodes[0])["pid"]}                     {cluster.nodes[0]}: its drags go on elsewhere
     deploy/cluster.sh up                starts it again
     deploy/cluster.sh down              ends all of it""")


def add(cluster):
    if len(cluster.nodes) == stack.MOST_NODES:
        raise SystemExit(f"there are {stack.MOST_NODES} servers, as many as the database has connections for")
    if not all(cluster.is_running(name) for name in (stack.DATABASE, stack.HAPROXY)):
        raise SystemExit("the cluster does not run; `deploy/cluster.sh up` starts it")
    name = cluster.add()
    print(f"{name} {cluster.address(name)} serves; sessions that begin fall to it, too, its share grows over 10 s")


def health(cluster, name):
    """What gRPC's health service says, by a client that nobody here wrote."""
    if not cluster.is_running(name):
        return "ended"
    try:
        import grpc
    except ImportError:
        return "listens" if processes.accepts(cluster.port(name)) else "silent"
    with grpc.insecure_channel(cluster.address(name)) as channel:
        try:
            answer = channel.unary_unary("/grpc.health.v1.Health/Check")(b"", timeout=2)
        except grpc.RpcError as error:
            return error.code().name.lower()
    return {b"\x08\x01": "serving", b"\x08\x02": "draining"}.get(answer, "unknown")


def status(cluster):
    held = cluster.ask_database("SELECT node, count(*) FROM session_states WHERE lease_until > tissueform_now() GROUP BY node") or []
    sessions = dict(line.rsplit("|", 1) for line in held)
    free = dict(line.rsplit("|", 1) for line in cluster.ask_database("SELECT name, free_bytes / 1048576 FROM nodes") or [])
    seen = balancer.view(cluster)
    table = [("node", "pid", "port", "health", "sessions held", "free MiB", "HAProxy")]
    for name in cluster.names:
        process = cluster.process(name) or {"pid": "-"}
        is_node = name in cluster.nodes
        table.append((name, process["pid"], cluster.port("workstations") if name == stack.HAPROXY else cluster.port(name),
                      health(cluster, name) if is_node else "running" if cluster.is_running(name) else "ended",
                      sessions.get(name, "0") if is_node else "", free.get(name, "?") if is_node else "", seen.get(name, "")))
    widths = [max(len(str(row[column])) for row in table) for column in range(len(table[0]))]
    for row in table:
        print("  ".join(str(cell).ljust(width) for cell, width in zip(row, widths)).rstrip())
    return 0 if all(cluster.is_running(name) for name in cluster.names) else 1


def main():
    options = parse(sys.argv[1:])
    folder = pathlib.Path(options.state)
    stack.make_folder(folder.parent, "--state")
    # One command at a time.
    lock = os.open(folder.parent, os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    cluster = stack.Cluster(folder, options.programs, options.web)
    if options.command == "up":
        up(cluster, options)
        return 0
    if not cluster.exists:
        print("there is no cluster; `deploy/cluster.sh up` makes one")
        return 0 if options.command == "down" else 1
    if options.command == "add":
        add(cluster)
        return 0
    if options.command == "status":
        return status(cluster)
    cluster.down()
    print("ended")
    return 0


if __name__ == "__main__":
    sys.exit(main())
