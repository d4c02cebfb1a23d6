# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""HAProxy before the servers and the gateways of a cluster: started, asked, and told by its runtime socket."""

import csv
import io
import shutil
import socket
import time

import processes
import stack

PATIENCE_S = 60


def configuration(cluster):
    """Placeholder until deploy/haproxy/cluster.cfg is there."""
    named = "\n".join(f"    use-server {node} if {{ req.hdr(x-tissueform-node) {node} }}" for node in cluster.nodes)
    servers = "\n".join(f"    server {node} {cluster.address(node)} check inter 500ms fall 2 rise 1 proto h2" for node in cluster.nodes)
    gateways = "\n".join(f"    server {each} {cluster.address(each)} check inter 500ms fall 2 rise 1" for each in cluster.gateways)
    return f"""
global
    maxconn 8192
    stats socket {socket_path(cluster)} mode 600 level admin
defaults
    mode http
    timeout connect 5s
    timeout client 1h
    timeout server 1h
    timeout tunnel 90s
    option abortonclose
    retries 0
frontend workstations
    bind {cluster.address("workstations")} proto h2
    default_backend servers
backend servers
{named}
    balance hdr(x-tissueform-session)
    hash-type consistent
    http-request return status 200 content-type application/grpc hdr grpc-status 14 if {{ req.hdr(x-tissueform-node) -m found }} {{ nbsrv(servers) lt 0 }}
{servers}
frontend planner
    bind {cluster.address("browsers")}
    default_backend gateways
backend gateways
    balance leastconn
    option httpchk
    http-check send meth GET uri /readyz hdr host localhost
{gateways}
"""


def socket_path(cluster):
    return cluster.folder / "haproxy.sock"


def start(cluster):
    file = cluster.folder / "haproxy.cfg"
    file.write_text(configuration(cluster))
    return processes.start([shutil.which("haproxy", path=stack.SYSTEM_PATH), "-db", "-f", file], cluster.log(stack.HAPROXY))


def tell(cluster, words):
    """A command for the runtime socket; its answer; None where HAProxy does not run."""
    try:
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(5)
            connection.connect(str(socket_path(cluster)))
            connection.sendall(words.encode() + b"\n")
            answer = bytearray()
            while data := connection.recv(65536):
                answer += data
            return answer.decode()
    except OSError:
        return None


def view(cluster):
    """What HAProxy thinks of each server and gateway: name to "UP", "DOWN", ...; empty where it does not run."""
    text = tell(cluster, "show stat")
    if not text:
        return {}
    rows = csv.DictReader(io.StringIO(text.removeprefix("# ")))
    return {row["svname"]: row["status"] for row in rows if row["svname"] not in ("FRONTEND", "BACKEND")}


def wait_until_routing(cluster, patience_s=PATIENCE_S, needed=None):
    """Until it holds all servers and gateways for up, or `needed` servers."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        seen = view(cluster)
        wanted = (*cluster.nodes, *cluster.gateways) if needed is None else cluster.nodes
        up = [name for name in wanted if seen.get(name, "").startswith("UP")]
        if len(up) >= (len(wanted) if needed is None else needed):
            return
        time.sleep(0.05)
    raise SystemExit(f"HAProxy does not find all servers: {view(cluster)}; see {cluster.log(stack.HAPROXY)}")
