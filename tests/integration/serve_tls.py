#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A TLS server that speaks no HTTP/2, as a proxy before a server may be one. Prints `listening on HOST:PORT`, and runs until
its end is asked for.

  serve_tls.py passing CERTIFICATE KEY [PROTOCOL]    where ALPN finds no protocol in common, the handshake goes on without one
  serve_tls.py refusing CERTIFICATE KEY PROTOCOL     ... the handshake ends with an alert (`openssl s_server`)
"""

import re
import signal
import socket
import ssl
import subprocess
import sys
import threading


def hold(connection, context):
    try:
        with context.wrap_socket(connection, server_side=True) as encrypted:
            encrypted.recv(1)
    except OSError:
        pass


def pass_on(certificate, key, protocols):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    if protocols:
        context.set_alpn_protocols(protocols)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        print(f"listening on 127.0.0.1:{listener.getsockname()[1]}", flush=True)
        while True:
            threading.Thread(target=hold, args=(listener.accept()[0], context), daemon=True).start()


def refuse(certificate, key, protocol):
    command = ["openssl", "s_server", "-accept", "127.0.0.1:0", "-cert", certificate, "-key", key, "-alpn", protocol]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        signal.signal(signal.SIGTERM, lambda *_: server.terminate())
        for line in server.stdout:
            accepts = re.match(r"ACCEPT (127\.0\.0\.1:\d+)", line)
            if accepts:
                print(f"listening on {accepts.group(1)}", flush=True)


def main():
    how, certificate, key, *protocols = sys.argv[1:]
    if how == "refusing":
        refuse(certificate, key, *protocols)
    else:
        pass_on(certificate, key, protocols)


if __name__ == "__main__":
    main()
