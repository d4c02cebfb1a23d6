#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Drags through HAProxy by deploy/haproxy/grpc.cfg, first alone, then beside 1,100 connections that others hold open.

  flood_haproxy.py TISSUEFORM TISSUEFORM_SERVER CONFIGURATION [SECONDS]

Prints what was held and turned away, and the age of pictures. Exit code 77 when haproxy or openssl is missing.
"""

import json
import os
import pathlib
import resource
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import time

PATIENCE_S = 30
CONNECTIONS = 1100
ADDRESSES = 6  # from which they come; HAProxy takes 200 of each


def make_certificates(folder):
    """An authority, and a certificate of it with its key in one file: of localhost, and of the proxy."""
    def run(*arguments):
        subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True)

    def new_key(name, *more):
        run("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-keyout", folder / f"{name}.key", *more)
    new_key("ca", "-x509", "-days", 2, "-subj", "/CN=authority", "-out", folder / "ca.pem")
    for name, alternative in (("server", "DNS:localhost"), ("proxy", "DNS:proxy.example.org")):
        new_key(name, "-subj", f"/CN={name}", "-out", folder / "request")
        (folder / "extensions").write_text(f"subjectAltName={alternative}\n", encoding="ascii")
        run("x509", "-req", "-in", folder / "request", "-CA", folder / "ca.pem", "-CAkey", folder / "ca.key", "-CAcreateserial", "-days", 2,
            "-extfile", folder / "extensions", "-out", folder / f"{name}.pem")
        (folder / f"{name}-both.pem").write_bytes((folder / f"{name}.pem").read_bytes() + (folder / f"{name}.key").read_bytes())


def start_server(program, folder):
    """The process and its HOST:PORT."""
    process = subprocess.Popen([program, "--in-memory", "--port", "0", "--log-level", "warn", "--tls-cert", folder / "server.pem", "--tls-key",
                                folder / "server.key", "--tls-client-ca", folder / "ca.pem", "--gateway-name", "proxy.example.org"],
                               stdout=subprocess.PIPE, text=True)
    return process, process.stdout.readline().split()[-1]


def start_haproxy(program, configuration, folder, server, listener):
    """On a socket that listens already."""
    os.set_inheritable(listener.fileno(), True)
    environment = os.environ | {"TISSUEFORM_LISTEN": f"fd@{listener.fileno()}", "TISSUEFORM_CERTIFICATE": str(folder / "server-both.pem"),
                                "TISSUEFORM_SERVER": server, "TISSUEFORM_SERVER_CA": str(folder / "ca.pem"),
                                "TISSUEFORM_SERVER_NAME": "localhost", "TISSUEFORM_PROXY": str(folder / "proxy-both.pem")}
    return subprocess.Popen([program, "-db", "-f", configuration], env=environment, close_fds=False)


def connect(port, source, context):
    """A connection with its handshake done; None: turned away."""
    try:
        plain = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S, source_address=(source, 0))
        return context.wrap_socket(plain, server_hostname="localhost")
    except OSError:
        return None


def drag(program, port, folder, seconds):
    """Pictures' ages and what failed, of one drag."""
    out = folder / "load.json"
    run = subprocess.run([program, "load", "--server", f"localhost:{port}", "--tls-ca", folder / "ca.pem", "--sessions", "1", "--churn", "0",
                          "--seconds", str(seconds), "--json", out], capture_output=True, text=True, timeout=10 * PATIENCE_S, check=False)
    if run.returncode != 0:
        raise SystemExit(run.stderr)
    return json.loads(out.read_text())["drags"][0]


def main():
    program, server_platform, configuration, *more = sys.argv[1:]
    seconds = float(more[0]) if more else 3
    haproxy = shutil.which("haproxy", path="/usr/sbin:/usr/bin")
    if haproxy is None or shutil.which("openssl") is None:
        print("haproxy or openssl is missing")
        sys.exit(77)
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    processes, held = [], []
    with tempfile.TemporaryDirectory() as name, socket.create_server(("127.0.0.1", 0), backlog=1024) as listener:
        folder, port = pathlib.Path(name), listener.getsockname()[1]
        make_certificates(folder)
        try:
            process, address = start_server(server_platform, folder)
            processes.append(process)
            processes.append(start_haproxy(haproxy, configuration, folder, address, listener))
            context = ssl.create_default_context(cafile=folder / "ca.pem")
            context.set_alpn_protocols(["h2"])
            for title, sources in (("alone", []), ("beside the connections", [f"127.0.0.{2 + i % ADDRESSES}" for i in range(CONNECTIONS)]),
                                   ("beside those of one address", ["127.0.0.9"] * CONNECTIONS)):
                begin = time.monotonic()
                tried = [connect(port, source, context) for source in sources]
                held = [one for one in tried if one is not None]
                took = time.monotonic() - begin
                result = drag(program, port, folder, seconds)
                age = result["picture_age_ms"]
                print(f"{title}: {len(held)} held, {len(tried) - len(held)} turned away")
                print(f"  {result['frames']} frames, picture age p50 {age['p50']:.1f} ms, p99 {age['p99']:.1f} ms; connecting took {took:.1f} s",
                      file=sys.stderr)
                for one in held:
                    one.close()
        finally:
            for process in processes:
                process.terminate()
                process.wait()


if __name__ == "__main__":
    main()
