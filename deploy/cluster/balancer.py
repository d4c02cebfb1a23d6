# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""HAProxy before the servers and the gateways of a cluster: started, asked, and controlled by its runtime socket."""

import csv
import io
import shutil
import socket
import time

import processes

NAME = "haproxy"
PATIENCE_S = 60
CONFIGURATION = processes.ROOT / "deploy/haproxy/cluster.cfg"
LONGEST_SOCKET = 107


def socket_path(cluster):
    path = cluster.folder / "haproxy.sock"
    if len(str(path)) > LONGEST_SOCKET:
        raise SystemExit(f"{path} is too long for a socket; name a folder with a shorter path by --state")
    return path


def environment(cluster):
    """What deploy/haproxy/cluster.cfg reads."""
    words = {"LISTEN": cluster.address("workstations"), "LISTEN_WEB": cluster.address("browsers"),
             "LISTEN_GATEWAYS": cluster.address("calls_of_gateways"), "SOCKET": str(socket_path(cluster))}
    for number, node in enumerate(cluster.places, 1):
        words |= {f"NODE_{number}": node, f"SERVER_{number}": cluster.address(node)}
    for number, gateway in enumerate(cluster.gateways, 1):
        words[f"GATEWAY_{number}"] = cluster.address(gateway)
    return {f"TISSUEFORM_{name}": value for name, value in words.items()}


def start(cluster):
    return processes.start([shutil.which("haproxy", path=processes.SYSTEM_PATH), "-db", "-f", CONFIGURATION], cluster.log(NAME),
                           environment=environment(cluster))


def send_command(cluster, words):
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
    text = send_command(cluster, "show stat")
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
    raise SystemExit(f"HAProxy does not find all servers: {view(cluster) or 'it does not answer'}; see {cluster.log(NAME)}")
