#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Runs `tissueform demo --serve` while its default port is taken, opens the address that it prints as a browser would, and
ends it by Ctrl-C.

  demo_serves_planner.py TISSUEFORM OUT_FOLDER

Exit code 1 and a sentence when something is not as it should be.
"""

import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

PATIENCE_S = 120
DEFAULT_PORT = 8080


def take_default_port():
    """A socket that listens there; None where another program does so already."""
    try:
        return socket.create_server(("127.0.0.1", DEFAULT_PORT))
    except OSError:
        return None


def fetch(url):
    with urllib.request.urlopen(url, timeout=30) as answer:
        return answer.status, answer.headers, answer.read().decode()


def await_ready(address):
    """The gateway takes calls at once and is ready when it has heard from the server, a moment later."""
    for _ in range(300):
        try:
            fetch(address + "/readyz")
            return
        except urllib.error.HTTPError:
            time.sleep(0.1)
    sys.exit("no server behind the gateway")


def check_planner(url):
    address, case = re.fullmatch(r"(http://127\.0\.0\.1:\d+)/#case=([0-9a-f]{64})", url).groups()
    status, headers, page = fetch(address + "/")
    script = re.search(r'src="\.?/(assets/[^"]+\.js)"', page)
    policy = headers["content-security-policy"]
    if status != 200 or script is None or "default-src" not in policy or "unsafe" in policy.replace("'wasm-unsafe-eval'", ""):
        sys.exit(f"the page is not the planner's: {status}, {policy}, {page[:200]}")
    if fetch(f"{address}/{script.group(1)}")[0] != 200:
        sys.exit("the page's script is not there")
    await_ready(address)
    # GetCase as gRPC-Web: what a browser sends for it.
    name = b"cases/" + case.encode()
    message = b"\x0a" + bytes([len(name)]) + name
    request = urllib.request.Request(address + "/tissueform.v1.CaseService/GetCase", method="POST",
                                     data=b"\0" + len(message).to_bytes(4, "big") + message,
                                     headers={"content-type": "application/grpc-web+proto"})
    with urllib.request.urlopen(request, timeout=30) as answer:
        body = answer.read()
    if name not in body or b"grpc-status: 0" not in body.replace(b":0", b": 0"):
        sys.exit(f"the case is not the server's: {body[:200]}")


def main():
    program, out = sys.argv[1:]
    listener = take_default_port()
    demo = subprocess.Popen([program, "demo", "--serve", "--seconds", "0.3", "--out", out], stdout=subprocess.PIPE, text=True)
    patience = threading.Timer(PATIENCE_S, demo.kill)
    patience.start()
    output = ""
    address = None
    try:
        for line in demo.stdout:
            output += line
            address = re.match(r"the planner, in a browser: (\S+)", line)
            if address is not None or line.startswith("no planner: "):
                break
        if address is None:
            sys.exit(f"no address: {output}")
        if f"port {DEFAULT_PORT} is in use; the planner uses a free one" not in output:
            sys.exit(f"the demo does not say that its port is taken: {output}")
        check_planner(address.group(1))
    finally:
        demo.send_signal(signal.SIGINT)
        demo.communicate()
        patience.cancel()
        if listener is not None:
            listener.close()
    if demo.returncode != 0:
        sys.exit(f"the demo ended with {demo.returncode}: {output}")


if __name__ == "__main__":
    main()
