#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Runs gateway_calls.py through HAProxy with TLS, by deploy/haproxy/planner.cfg and a certificate of its own.

  behind_haproxy.py GATEWAY_URL FOLDER_OF_OUR_PROTOS CONFIGURATION

Exit code 77 when haproxy, openssl or a Python module is missing.
"""

import os
import pathlib
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

PATIENCE_S = 30


def make_certificate(folder):
    """Certificate and key in one file, for localhost."""
    key, certificate, both = folder / "key.pem", folder / "certificate.pem", folder / "both.pem"
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2",
                    "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-keyout", key, "-out", certificate],
                   check=True, capture_output=True)
    both.write_bytes(certificate.read_bytes() + key.read_bytes())
    return certificate, both


def wait_until_ready(url, context, process):
    """Once its check has passed HAProxy sends requests on."""
    end = time.monotonic() + PATIENCE_S
    while process.poll() is None and time.monotonic() < end:
        try:
            with urllib.request.urlopen(f"{url}/readyz", context=context, timeout=PATIENCE_S) as reply:
                return dict(reply.headers)
        except (urllib.error.HTTPError, ConnectionError):
            time.sleep(0.05)
    raise SystemExit("HAProxy does not answer")


def main():
    gateway, protos, configuration = sys.argv[1:]
    haproxy = shutil.which("haproxy", path="/usr/sbin:/usr/bin")
    if haproxy is None or shutil.which("openssl") is None:
        print("haproxy or openssl is missing")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as name, socket.create_server(("127.0.0.1", 0)) as listener:
        certificate, both = make_certificate(pathlib.Path(name))
        os.set_inheritable(listener.fileno(), True)
        environment = os.environ | {"TISSUEFORM_LISTEN": f"fd@{listener.fileno()}", "TISSUEFORM_CERTIFICATE": str(both),
                                    "TISSUEFORM_GATEWAY": gateway.removeprefix("http://")}
        process = subprocess.Popen([haproxy, "-db", "-f", configuration], env=environment, close_fds=False)
        try:
            url = f"https://localhost:{listener.getsockname()[1]}"
            headers = wait_until_ready(url, ssl.create_default_context(cafile=certificate), process)
            print("tls:", "strict-transport-security" in headers, "content-security-policy" in headers)
            sys.stdout.flush()
            calls = pathlib.Path(__file__).with_name("gateway_calls.py")
            sys.exit(subprocess.run([sys.executable, calls, url, protos, certificate], check=False).returncode)
        finally:
            process.terminate()
            process.wait()


if __name__ == "__main__":
    main()
