# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Tokens between us and programs that nobody here wrote: PyJWT makes some that the server takes, and forged ones that it
refuses; it reads those of `tissueform token`. grpcio brings them. Nothing of a token or a name may be in the server's log.

  tokens_elsewhere.py FOLDER_OF_PROGRAMS FOLDER      exit code 77 without the modules
"""

import json
import pathlib
import shutil
import subprocess
import sys
import time
import urllib.request

try:
    import grpc
    import jwt
except ImportError:
    sys.exit(77)

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "deploy"))
from free_ports import free_ports

ISSUER, AUDIENCE, NAME = "https://login.example", "tissueform", "planted.patient.name"
METHOD = "/tissueform.v1.ServerInfoService/GetServerInfo"
PATIENCE = 30

programs, folder = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
brought = []  # everything that must not be logged


def run(*words, **more):
    return subprocess.run(words, check=True, capture_output=True, text=True, timeout=PATIENCE, **more).stdout


def make_keys():
    keys = []
    for name, options in (("ec", []), ("rsa", ["--rsa", "2048"])):
        run(programs / "tissueform", "token", "keygen", "--out", folder / name, *options)
        keys += json.loads((folder / name / "jwks.json").read_text())["keys"]
    (folder / "jwks.json").write_text(json.dumps({"keys": keys}))
    return keys


def ask(channel, *headers):
    """The code, and why the token was refused."""
    brought.extend(value for _, value in headers)
    try:
        channel.unary_unary(METHOD)(b"", metadata=headers, timeout=PATIENCE)
        return "OK", ""
    except grpc.RpcError as error:
        return error.code().name, error.details()


def bearer(token):
    return "authorization", f"Bearer {token}"


def claims(**more):
    now = int(time.time())
    return {"iss": ISSUER, "aud": [AUDIENCE, "other"], "sub": NAME, "iat": now, "exp": now + 600, **more}


def check_their_tokens(channel, keys):
    for key, name, algorithm in zip(keys, ("ec", "rsa"), ("ES256", "RS256")):
        private = (folder / name / "private.pem").read_text()
        sign = lambda body, **header: jwt.encode(body, private, algorithm, headers={"kid": key["kid"], **header})
        assert ask(channel, bearer(sign(claims()))) == ("OK", ""), algorithm
        good = sign(claims())
        for forged, reason in (
            (sign(claims(exp=int(time.time()) - 100)), "expired"),
            (sign(claims(aud="other")), 'audience is "other", and this server is'),
            (sign(claims(iss="https://evil.example")), 'issuer is "https://evil.example"; this server accepts only tokens of'),
            (sign(claims(), kid="unknown"), "key does not belong to"),
            (sign(claims(), jku="https://evil.example/keys"), "contains a key"),
            (jwt.encode(claims(), None, "none", headers={"kid": key["kid"]}), "algorithm"),
            (jwt.encode(claims(), "secret" * 6, "HS256", headers={"kid": key["kid"]}), "algorithm"),
            (good[:-9] + "A" * 9, "signature"),
            ("a" * 9000, "longer than"),
        ):
            code, details = ask(channel, bearer(forged))
            # A signature's last digit has bits that no byte holds.
            assert code == "UNAUTHENTICATED" and (reason in details or "not a signed" in details), (reason, code, details)
        assert ask(channel, bearer(good), bearer(good))[0] == "UNAUTHENTICATED", "two headers"
        assert ask(channel, bearer(good)) == ("OK", "")
    assert ask(channel)[0] == "UNAUTHENTICATED", "no token"


def check_our_tokens(channel):
    for name, algorithm in (("ec", "ES256"), ("rsa", "RS256")):
        token = run(programs / "tissueform", "token", "make", "--key", folder / name / "private.pem", "--issuer", ISSUER,
                    "--audience", AUDIENCE, "--subject", NAME, "--role", "admin", "--project", "jaws").strip()
        key = jwt.PyJWKSet.from_json((folder / name / "jwks.json").read_text()).keys[0].key
        for public in (key, (folder / name / "public.pem").read_text()):
            read = jwt.decode(token, public, [algorithm], audience=AUDIENCE, issuer=ISSUER,
                              options={"require": ["exp", "iat", "sub", "jti"]})
            assert read["sub"] == NAME and read["tissueform_roles"] == ["admin"], read
        assert read["exp"] - read["iat"] == 3600, read
        shown = json.loads(run(programs / "tissueform", "token", "show", input=token))
        assert shown["claims"] == read and shown["header"] == jwt.get_unverified_header(token), shown
        assert ask(channel, bearer(token)) == ("OK", "")


def main():
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    keys = make_keys()
    (metrics_port,) = free_ports(1)
    server = subprocess.Popen(
        [programs / "tissueform-server", "--in-memory", "--port", "0", "--log-level", "trace", "--token-issuer", ISSUER,
         "--token-audience", AUDIENCE, "--token-keys", folder / "jwks.json", "--metrics-port", str(metrics_port)],
        stdout=subprocess.PIPE, stderr=(folder / "log.txt").open("w"), text=True)
    try:
        address = server.stdout.readline().split()[-1]
        with grpc.insecure_channel(address) as channel:
            check_their_tokens(channel, keys)
            check_our_tokens(channel)
        # gRPC takes no headers of this size, and closes the connection after them.
        with grpc.insecure_channel(address, [("grpc.use_local_subchannel_pool", 1)]) as channel:
            assert ask(channel, bearer("a" * (1 << 20)))[0] == "RESOURCE_EXHAUSTED", "a megabyte"
        with grpc.insecure_channel(address) as channel:
            check_our_tokens(channel)
        with urllib.request.urlopen(f"http://127.0.0.1:{metrics_port}/metrics", timeout=PATIENCE) as answer:
            metrics = answer.read().decode()
    finally:
        server.terminate()
        server.wait(PATIENCE)
    log = (folder / "log.txt").read_text()
    assert "UNAUTHENTICATED" in log, "the log tells nothing"
    assert 'tissueform_token_failures_total{reason="expired"} 2' in metrics, metrics
    for secret in [NAME, *(part for value in brought for part in value.removeprefix("Bearer ").split(".") if part)]:
        assert secret not in log + metrics, f"the log or the metrics have a secret of {len(secret)} characters"
    print(f"{len(brought)} tokens, {len(log)} bytes of log without any of them")


main()
