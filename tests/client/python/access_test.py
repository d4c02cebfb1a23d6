# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Logins and TLS, and what a local server and the doctor say."""

import importlib.metadata
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest
import unittest.mock

import grpc
import jwt
import tissueform
from programs import SERVER, start_server, tissueform_command
from tissueform import Tls

ISSUER, AUDIENCE = "https://login.example", "tissueform"


def setUpModule():
    global folder, server, private, key_id
    folder = tempfile.TemporaryDirectory()
    keys = pathlib.Path(folder.name) / "keys"
    tissueform_command("token", "keygen", "--out", keys)
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj",
                    "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", "key.pem", "-out", "cert.pem"],
                   cwd=folder.name, check=True, capture_output=True)
    os.chmod(f"{folder.name}/key.pem", 0o600)
    private = (keys / "private.pem").read_text()
    key_id = json.loads((keys / "jwks.json").read_text())["keys"][0]["kid"]
    server = start_server("--token-issuer", ISSUER, "--token-audience", AUDIENCE, "--token-keys", str(keys / "jwks.json"),
                          "--tls-cert", f"{folder.name}/cert.pem", "--tls-key", f"{folder.name}/key.pem")


def tearDownModule():
    server.close()
    folder.cleanup()


def token(**more):
    now = int(time.time())
    claims = {"iss": ISSUER, "aud": AUDIENCE, "sub": "planted.name", "iat": now, "exp": now + 600, **more}
    return jwt.encode(claims, private, "ES256", headers={"kid": key_id})


def tls():
    return Tls(ca=f"{folder.name}/cert.pem")


class LoginTest(unittest.TestCase):
    def test_a_token_is_accepted_and_never_shown(self):
        given = token()
        with tissueform.connect(server.address, token=given, tls=tls()) as client:
            self.assertEqual(list(client.sessions()), [])
            self.assertNotIn(given, repr(client) + repr(vars(client)))

    def test_an_expired_token_says_what_to_do(self):
        expired = token(exp=int(time.time()) - 100)
        with self.assertRaises(tissueform.Unauthenticated) as caught:
            tissueform.connect(server.address, token=expired, tls=tls())
        self.assertEqual(caught.exception.reason, "UNAUTHENTICATED")
        self.assertIn("expired", caught.exception.message)
        self.assertIn("log in again", caught.exception.advice)
        self.assertNotIn(expired, str(caught.exception))

    def test_a_token_file_must_be_private(self):
        path = pathlib.Path(folder.name) / "token"
        path.write_text(token())
        path.chmod(0o644)
        with self.assertRaises(tissueform.Unauthenticated) as caught:
            tissueform.connect(server.address, token_file=path, tls=tls())
        self.assertEqual(caught.exception.advice, "chmod 600 it")
        path.chmod(0o600)
        tissueform.connect(server.address, token_file=path, tls=tls()).close()

    def test_what_is_not_a_token_is_refused_before_it_is_sent(self):
        for wrong in ("", "two words", "a\nb", "x" * (17 << 10)):
            with self.assertRaises(tissueform.InvalidInput):
                tissueform.connect(server.address, token=wrong, tls=tls())
        with self.assertRaises(tissueform.NotFound):
            tissueform.connect(server.address, token_file="/nowhere/token", tls=tls())

    def test_true_means_the_authorities_of_this_machine(self):
        with unittest.mock.patch.dict(os.environ, {"SSL_CERT_FILE": f"{folder.name}/cert.pem"}):
            tissueform.connect(server.address, token=token(), tls=True).close()
        with self.assertRaisesRegex(tissueform.InvalidInput, "needs its key"):
            tissueform.connect(server.address, tls=Tls(certificate=f"{folder.name}/cert.pem"))

    def test_a_certificate_of_another_authority_is_refused(self):
        with self.assertRaises(tissueform.ServerUnavailable):
            tissueform.connect(server.address, token=token(), tls=True, timeout=0.3)
        with self.assertRaisesRegex(tissueform.NotFound, "cannot read /nowhere/ca.pem"):
            tissueform.connect(server.address, tls=Tls(ca="/nowhere/ca.pem"))


class DoctorTest(unittest.TestCase):
    def test_a_healthy_server_is_ok_in_all_lines(self):
        lines = tissueform.doctor(server.address, token=token(), tls=tls())
        self.assertEqual([line.check for line in lines], ["libraries", "route", "login", "clock", "version", "limits", "work"])
        self.assertEqual({line.finding for line in lines}, {"ok"})

    def test_the_first_failure_ends_it_with_advice(self):
        for address, options, check in (("127.0.0.1:1", {}, "route"), (server.address, {"tls": tls()}, "health")):
            lines = tissueform.doctor(address, **options)
            self.assertEqual((lines[-1].check, lines[-1].finding), (check, "failed"))
            self.assertTrue(lines[-1].advice)

    def test_the_command_prints_lines_and_fails_with_the_doctor(self):
        with start_server() as plain:
            for address, code, words in ((plain.address, 0, "ok       work"), ("127.0.0.1:1", 1, "FAILED   route")):
                done = subprocess.run([sys.executable, "-m", "tissueform", "doctor", address], stdout=subprocess.PIPE, text=True)
                self.assertEqual(done.returncode, code)
                self.assertIn(words, done.stdout)

    def test_without_a_server_the_command_names_the_versions_of_this_machine(self):
        done = subprocess.run([sys.executable, "-m", "tissueform", "doctor"], stdout=subprocess.PIPE, text=True, check=True)
        self.assertRegex(done.stdout, rf"^ok       libraries   Python 3\.\S+, tissueform \S+, grpcio {re.escape(grpc.__version__)}, protobuf \S+, numpy \S+\n$")

    def test_the_package_has_the_version_of_the_server(self):
        (line,) = [line for line in tissueform.doctor(server.address, token=token(), tls=tls()) if line.check == "version"]
        own = importlib.metadata.version("tissueform")
        self.assertEqual(line.text, f"server {own}, this package {own}, protocol tissueform.v1")

    def test_with_an_old_library_the_command_prints_the_line_for_pip_alone(self):
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "grpc.py").write_text('__version__ = "1.48.4"')
            done = subprocess.run([sys.executable, "-m", "tissueform", "doctor"], env={**os.environ, "PYTHONPATH": folder},
                                  stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"^tissueform needs grpcio 1\.49 or newer, found 1\.48\.4: pip install --upgrade .*\n$")


class LocalServerTest(unittest.TestCase):
    def test_it_ends_with_its_block(self):
        with start_server() as local:
            local.connect().close()
        with self.assertRaises(tissueform.ServerUnavailable):
            tissueform.connect(local.address, timeout=0.2)

    def test_it_ends_with_a_parent_that_is_killed(self):
        script = (f"import os, signal, tissueform; s = tissueform.local({str(SERVER)!r}); print(s.address, flush=True); "
                  "os.kill(os.getpid(), signal.SIGKILL)")
        done = subprocess.run([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
        give_up = time.monotonic() + 10
        while time.monotonic() < give_up:
            try:
                tissueform.connect(done.stdout.strip(), timeout=0.1).close()
            except tissueform.ServerUnavailable:
                return
        self.fail("the server still answers")


if __name__ == "__main__":
    unittest.main()
