#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Asks servers behind deploy/haproxy/cluster.cfg with python3-grpcio, a client that nobody here wrote.

  behind_cluster_haproxy.py TISSUEFORM_SERVER CONFIGURATION

Three small servers that say their names stand for a cluster, and a tissueform-server for what health says; also through the
tissueform-gateway beside it. A line for each
property that holds; exit code 1 with what does not, 77 when haproxy or a Python module is missing.
"""

import collections
import http.client
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from concurrent import futures

try:
    import grpc
except ImportError:
    print("python3-grpcio is missing")
    sys.exit(77)

PATIENCE_S = 30
SESSION, NODE, ADDRESS = "x-tissueform-session", "x-tissueform-node", "x-tissueform-client-address"
SHORT, ENDLESS = "/tissueform.v1.MeshService/GetMesh", "/tissueform.v1.CaseService/ReadCase"  # that the gateway serves
SERVING, NOT_SERVING = b"\x08\x01", b"\x08\x02"
CROWD = 5


ENDLESS_BYTES = 200_000
STALLED_S = 2


class Node(grpc.GenericRpcHandler):
    """A server of a cluster: its name is every answer, and a call for another one is refused. Whom it was last called for."""

    def __init__(self, name):
        self.name, self.health, self.port, self.called_for = name, SERVING, 0, None
        self.start()

    def start(self):
        self.server = grpc.server(futures.ThreadPoolExecutor(8))
        self.server.add_generic_rpc_handlers((self,))
        self.port = self.server.add_insecure_port(f"127.0.0.1:{self.port}")
        self.server.start()

    def service(self, details):
        if details.method == "/grpc.health.v1.Health/Check":
            return grpc.unary_unary_rpc_method_handler(lambda request, context: self.health)
        if details.method == "/test.Test/Stream":
            return grpc.stream_stream_rpc_method_handler(self.answer_each)
        if details.method == ENDLESS:
            return grpc.unary_stream_rpc_method_handler(self.answer_without_end)
        return grpc.unary_unary_rpc_method_handler(self.answer)

    def check(self, context):
        named = [value for key, value in context.invocation_metadata() if key == NODE]
        if any(value != self.name for value in named):
            context.abort(grpc.StatusCode.UNAVAILABLE, "wrong node")

    def answer(self, request, context):
        self.check(context)
        self.called_for = dict(context.invocation_metadata()).get(ADDRESS)
        context.send_initial_metadata(((NODE, self.name),))
        return self.name.encode()

    def answer_without_end(self, request, context):
        self.check(context)
        while context.is_active():
            yield bytes(ENDLESS_BYTES)

    def answer_each(self, requests, context):
        self.check(context)
        for _ in requests:
            yield self.name.encode()


class Haproxy:
    """cluster.cfg before the nodes, with its runtime socket."""

    def __init__(self, configuration, folder, servers):
        self.socket = f"{folder}/haproxy.sock"
        listener = socket.create_server(("127.0.0.1", 0))
        web, calls = socket.create_server(("127.0.0.1", 0)), socket.create_server(("127.0.0.1", 0))
        for each in (listener, web, calls):
            os.set_inheritable(each.fileno(), True)
        self.port, self.port_of_gateways = listener.getsockname()[1], calls.getsockname()[1]
        environment = os.environ | {"TISSUEFORM_LISTEN": f"fd@{listener.fileno()}", "TISSUEFORM_LISTEN_WEB": f"fd@{web.fileno()}",
                                    "TISSUEFORM_LISTEN_GATEWAYS": f"fd@{calls.fileno()}", "TISSUEFORM_SOCKET": self.socket}
        for number, (name, port) in enumerate(servers, 1):
            environment |= {f"TISSUEFORM_NODE_{number}": name, f"TISSUEFORM_SERVER_{number}": f"127.0.0.1:{port}"}
        self.process = subprocess.Popen([shutil.which("haproxy", path="/usr/sbin:/usr/bin"), "-db", "-f", configuration],
                                        env=environment, close_fds=False, stderr=subprocess.DEVNULL)
        for each in (listener, web, calls):
            each.close()
        self.channel = grpc.insecure_channel(f"127.0.0.1:{self.port}")
        self.unary = self.channel.unary_unary("/test.Test/Call")
        self.stream = self.channel.stream_stream("/test.Test/Stream")

    def send_command(self, words):
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(self.socket)
            connection.sendall(words.encode() + b"\n")
            return b"".join(iter(lambda: connection.recv(1 << 16), b"")).decode()

    def states(self):
        lines = [line.split(",") for line in self.send_command("show stat").splitlines()]
        return {line[1]: line[17] for line in lines if line[0] == "servers"}

    def wait(self, name, state):
        return until(lambda: self.states().get(name, "").startswith(state))

    def ask(self, session=None, node=None):
        headers = [(key, value) for key, value in ((SESSION, session), (NODE, node)) if value is not None]
        try:
            return self.unary(b"", metadata=headers, timeout=PATIENCE_S).decode()
        except grpc.RpcError as error:
            return error.code()

    def stop(self):
        self.channel.close()
        self.process.terminate()
        self.process.wait(PATIENCE_S)


class Gateway:
    """A gateway before HAProxy, as docs/gateway.md has it."""

    def __init__(self, program, haproxy):
        self.process = subprocess.Popen([program, "--server", f"127.0.0.1:{haproxy.port_of_gateways}", "--listen", "127.0.0.1:0", "--trust-forwarded-from", "127.0.0.1",
                                         "--calls-per-channel", "1", "--channels-per-server", "100", "--log-level", "off"], stdout=subprocess.PIPE, text=True)
        self.port = int(self.process.stdout.readline().rpartition(":")[2])

    def post(self, path, headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        connection.request("POST", path, bytes(5), {"content-type": "application/grpc-web+proto", **headers})
        return connection.getresponse()

    def ask(self, **headers):
        """Which node answers, by the reply's header; None: none of them."""
        with self.post(SHORT, {key.replace("_", "-"): value for key, value in headers.items()}) as response:
            response.read()
            return response.getheader(NODE)

    def is_ready(self):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        connection.request("GET", "/readyz")
        return connection.getresponse().status == 200

    def stop(self):
        self.process.terminate()
        self.process.wait(PATIENCE_S)


def until(condition):
    """Seconds until it holds."""
    start = time.monotonic()
    while time.monotonic() - start < PATIENCE_S:
        try:
            if condition():
                return time.monotonic() - start
        except OSError:
            pass
        time.sleep(0.02)
    raise SystemExit("waited in vain")


def expect(condition, what):
    print(("" if condition else "NOT: ") + what, flush=True)
    if not condition:
        sys.exit(1)


def ask_all(haproxy, keys):
    with futures.ThreadPoolExecutor(8) as threads:
        return dict(zip(keys, threads.map(haproxy.ask, keys)))


def check_sessions(haproxy, nodes, keys):
    first = ask_all(haproxy, keys)
    expect(set(first.values()) == {node.name for node in nodes}, "the sessions are on all servers")
    expect(ask_all(haproxy, keys) == first, "the calls of a session go to one server")
    streams = [next(haproxy.stream(iter([b""]), metadata=[(SESSION, key)], timeout=PATIENCE_S)).decode() for key in keys[:20]]
    expect(streams == [first[key] for key in keys[:20]], "streams go where the calls go")
    without = collections.Counter(haproxy.ask() for _ in range(30))
    expect(len(without) == len(nodes), "calls of no session go around")
    return first


def check_death(haproxy, nodes, first):
    nodes[0].server.stop(None).wait()
    haproxy.wait(nodes[0].name, "DOWN")
    moved = ask_all(haproxy, list(first))
    expect(all(moved[key] == first[key] for key in first if first[key] != nodes[0].name), "a server that dies moves its own sessions")
    expect(nodes[0].name not in moved.values(), "and all of them")
    expect(haproxy.ask(node=nodes[0].name) == grpc.StatusCode.UNAVAILABLE, "the header of a dead server is answered UNAVAILABLE")
    nodes[0].start()
    haproxy.wait(nodes[0].name, "UP")
    check_crowd(haproxy, nodes[0])


def check_crowd(haproxy, node):
    """Streams last: of a server that has just come back none waits until another one ends."""
    stays = threading.Event()

    def poses():
        yield b""
        stays.wait(PATIENCE_S)

    streams = [haproxy.stream(poses(), metadata=[(NODE, node.name)], timeout=PATIENCE_S) for _ in range(CROWD)]
    try:
        answered = [next(stream).decode() for stream in streams]
    except grpc.RpcError as error:
        answered = error.details()
    stays.set()
    expect(answered == [node.name] * CROWD, f"a server that has come back takes {CROWD} streams at once ({answered})")


def check_header(haproxy, nodes):
    for node in nodes:
        expect({haproxy.ask(session=str(i), node=node.name) for i in range(10)} == {node.name}, f"the header {node.name} goes to it alone")
    forged = ("nobody", "x" * 4000, "a b", "servers/" + nodes[0].name, "%[src]", nodes[0].name.upper())
    expect({haproxy.ask(node=name) for name in forged} == {grpc.StatusCode.UNAVAILABLE}, "a forged header is answered UNAVAILABLE")


def check_drain(haproxy, nodes):
    node = nodes[1]
    stays = threading.Event()

    def poses():
        yield b""
        stays.wait(PATIENCE_S)
        yield b""

    stream = haproxy.stream(poses(), metadata=[(NODE, node.name)], timeout=PATIENCE_S)
    next(stream)
    node.health = NOT_SERVING
    seconds = haproxy.wait(node.name, "NOLB")
    expect(seconds < 2, "a server that says NOT_SERVING leaves within 2 s")
    expect(node.name not in ask_all(haproxy, [f"drained-{i}" for i in range(60)]).values(), "no session goes to it")
    stays.set()
    expect([each.decode() for each in stream] == [node.name], "its streams go on until it ends them")
    node.health = SERVING
    haproxy.wait(node.name, "UP")
    haproxy.send_command(f"set server servers/{node.name} state drain")
    expect(node.name not in ask_all(haproxy, [f"told-{i}" for i in range(60)]).values(), "nor when the operator says so")
    expect(haproxy.ask(node=node.name) == node.name, "who holds a session there still finds it")
    haproxy.send_command(f"set server servers/{node.name} state ready")


def check_gateway(program, haproxy, nodes):
    """What pages have of a gateway, though it has one address."""
    gateway = Gateway(program, haproxy)
    try:
        until(gateway.is_ready)
        for node in nodes:
            expect({gateway.ask(x_tissueform_node=node.name, x_tissueform_session=str(i)) for i in range(8)} == {node.name}, f"through a gateway, too, {node.name} goes to it alone")
        expect(gateway.ask(x_tissueform_node="nobody") is None, "and a forged header to none")
        keys = [f"page-{i}" for i in range(40)]
        # Once a server that has come back has its weight.
        until(lambda: set(ask_all(haproxy, keys).values()) == {node.name for node in nodes})
        until(lambda: {key: gateway.ask(x_tissueform_session=key) for key in keys} == ask_all(haproxy, keys))
        expect(True, "pages and workstations find a session at one server")
        check_addresses(gateway, haproxy, nodes[0])
        check_stalled(gateway, nodes[0])
        nodes[0].health = NOT_SERVING
        haproxy.wait(nodes[0].name, "NOLB")
        expect(all(gateway.is_ready() or time.sleep(0.1) for _ in range(20)), "a gateway stays ready while one of its servers drains")
        nodes[0].health = SERVING
        haproxy.wait(nodes[0].name, "UP")
    finally:
        gateway.stop()


def check_addresses(gateway, haproxy, node):
    gateway.ask(x_tissueform_node=node.name, x_forwarded_for="203.0.113.9")
    expect(node.called_for == "203.0.113.9", "servers hear the address that a gateway states")
    haproxy.unary(b"", metadata=[(NODE, node.name), (ADDRESS, "203.0.113.9")], timeout=PATIENCE_S)
    expect(node.called_for == "127.0.0.1", "and not what a workstation states")


def check_stalled(gateway, node):
    """A page that takes nothing stops no other one: HAProxy stops the whole connection, so each call has its own."""
    stalled = [gateway.post(ENDLESS, {NODE: node.name}) for _ in range(3)]
    for response in stalled:
        response.read(1)
    time.sleep(STALLED_S)
    start = time.monotonic()
    answers = {gateway.ask(x_tissueform_node=node.name) for _ in range(20)}
    expect(answers == {node.name} and time.monotonic() - start < STALLED_S, "a page that reads nothing holds up no other")
    for response in stalled:
        response.close()


def check_added(haproxy, node):
    server = f"servers/{node.name}"
    haproxy.send_command(f"add server {server} 127.0.0.1:{node.port} id 9 proto h2 check inter 500ms fastinter 200ms fall 2 rise 1;"
                 f"enable health {server}; enable server {server}")
    haproxy.wait(node.name, "UP")
    expect(haproxy.ask(node=node.name) == node.name, "a server that is added has its header")
    expect(node.name in ask_all(haproxy, [f"added-{i}" for i in range(200)]).values(), "and sessions of its own")
    node.health = NOT_SERVING
    haproxy.wait(node.name, "NOLB")


def check_half_open(haproxy):
    silent = [socket.create_connection(("127.0.0.1", haproxy.port)) for _ in range(100)]
    for each in silent[:50]:
        each.sendall(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n")
    expect(isinstance(haproxy.ask(session="beside"), str), "connections that say nothing hold nobody up")
    for each in silent:
        each.close()


def check_nobody(haproxy):
    for name in haproxy.states():
        if name != "BACKEND":
            haproxy.send_command(f"disable server servers/{name}")
    try:
        haproxy.unary(b"", timeout=PATIENCE_S)
        expect(False, "nobody answers")
    except grpc.RpcError as error:
        expect(error.code() == grpc.StatusCode.UNAVAILABLE and "no server is up" in error.details(), "without servers a client hears so")


def check_hung(haproxy, server, name):
    server.send_signal(signal.SIGSTOP)
    try:
        haproxy.wait(name, "DOWN")
    finally:
        server.send_signal(signal.SIGCONT)
    haproxy.wait(name, "UP")
    expect(True, "a server that is stopped is left out, and comes back")


def start_server(program, folder):
    server = subprocess.Popen([program, "--port", "0", "--data-dir", f"{folder}/data"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    return server, int(server.stdout.readline().rsplit(":", 1)[1])


def main():
    program, configuration = sys.argv[1:]
    if shutil.which("haproxy", path="/usr/sbin:/usr/bin") is None:
        print("haproxy is missing")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as folder:
        nodes = [Node(name) for name in ("a", "host-b:50051", "c.example.org")]
        server, port = start_server(program, folder)
        haproxy = Haproxy(configuration, folder, [(node.name, node.port) for node in nodes] + [("real", port)])
        try:
            for name in [node.name for node in nodes] + ["real"]:
                haproxy.wait(name, "UP")
            expect(True, "tissueform-server is up by its health")
            check_hung(haproxy, server, "real")
            haproxy.send_command("disable server servers/real")
            first = check_sessions(haproxy, nodes, [f"{i:032x}" for i in range(120)])
            check_header(haproxy, nodes)
            check_death(haproxy, nodes, first)
            check_drain(haproxy, nodes)
            check_gateway(pathlib.Path(program).with_name("tissueform-gateway"), haproxy, nodes)
            check_added(haproxy, Node("added:1"))
            check_half_open(haproxy)
            check_nobody(haproxy)
        finally:
            haproxy.stop()
            server.terminate()
            server.wait(PATIENCE_S)
            for node in nodes:
                node.server.stop(None)


if __name__ == "__main__":
    main()
