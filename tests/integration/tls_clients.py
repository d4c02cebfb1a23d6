#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Speaks with a server that asks for client certificates, by openssl, python3-grpcio and curl.

  tls_clients.py PORT AUTHORITY CERTIFICATE KEY

Prints a line for each. Exit code 77 when one of the programs is missing.
"""

import pathlib
import shutil
import subprocess
import sys

PATIENCE_S = 30
METHOD = "/tissueform.v1.ServerInfoService/GetServerInfo"

try:
    import grpc
except ImportError:
    grpc = None


def ask_openssl(port, version, authority, certificate, key):
    """What `openssl s_client` says of a connection by this version of TLS."""
    run = subprocess.run(["openssl", "s_client", "-connect", f"localhost:{port}", f"-{version}", "-CAfile", authority, "-cert", certificate,
                          "-key", key, "-alpn", "h2", "-verify_hostname", "localhost", "-verify_return_error"],
                         stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE_S, check=False)
    if run.returncode != 0 or b"Verify return code: 0 (ok)" not in run.stdout:
        return "refused"
    return "served, h2" if b"ALPN protocol: h2" in run.stdout else "served"


def ask_grpc(port, authority, certificate=None, key=None):
    """The code with which a call ends."""
    def read(path):
        return pathlib.Path(path).read_bytes() if path else None
    credentials = grpc.ssl_channel_credentials(read(authority), read(key), read(certificate))
    with grpc.secure_channel(f"localhost:{port}", credentials) as channel:
        call = channel.unary_unary(METHOD, request_serializer=lambda b: b, response_deserializer=lambda b: b)
        try:
            call(b"", timeout=PATIENCE_S)
        except grpc.RpcError as error:
            return error.code().name
    return "OK"


def ask_curl(url, options, body):
    """The content type of the answer to a gRPC call made by hand."""
    run = subprocess.run(["curl", "--silent", "--noproxy", "*", "--max-time", str(PATIENCE_S), "-H", "content-type: application/grpc", "-H", "te: trailers",
                          "--data-binary", f"@{body}", "--output", "/dev/null", "--write-out", "%{content_type}", *options, url + METHOD],
                         capture_output=True, timeout=2 * PATIENCE_S, check=False)
    return run.stdout.decode() if run.returncode == 0 and run.stdout else "refused"


def main():
    port, authority, certificate, key = sys.argv[1:]
    if grpc is None or shutil.which("openssl") is None or shutil.which("curl") is None:
        print("python3-grpcio, openssl or curl is missing: deploy/packages.txt lists them")
        sys.exit(77)
    for version in ("tls1_1", "tls1_2", "tls1_3"):
        print(f"openssl {version}:", ask_openssl(port, version, authority, certificate, key))
    print("python with certificate:", ask_grpc(port, authority, certificate, key))
    print("python without certificate:", ask_grpc(port, authority))
    body = pathlib.Path(key).with_name("empty_message")
    body.write_bytes(bytes(5))
    tls = ["--http2", "--cacert", authority]
    print("curl with certificate:", ask_curl(f"https://localhost:{port}", [*tls, "--cert", certificate, "--key", key], body))
    print("curl without certificate:", ask_curl(f"https://localhost:{port}", tls, body))
    print("curl in plain text:", ask_curl(f"http://localhost:{port}", ["--http2-prior-knowledge"], body))


if __name__ == "__main__":
    main()
