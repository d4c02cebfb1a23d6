#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""deploy/kubernetes is what the API knows, and fits the programs.

    tests/kubernetes/check_manifests.py schema | programs FOLDER | broken FOLDER | proxies FOLDER

schema: every object by validators of npm's kubernetes-models, which were made from the API's schema. programs: options, variables, ports, files, keys
of Secrets, memory, privileges. broken: each rule complains about a copy that is wrong. proxies: HAProxy reads both configurations, and lets a probe
through to the health service of a server with TLS, and nothing else. Exit code 77 where a program or module is missing, which is named.
"""

import copy
import json
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
try:
    import yaml  # noqa: F401, manifests needs it
except ImportError:
    print("python3-yaml is missing")
    sys.exit(SKIPPED)
import manifests

PATIENCE_S = 30


def unknown_to_the_api(objects):
    modules = manifests.ROOT / "deploy/protocol_tools/node_modules"
    node = shutil.which("node")
    if node is None or not (modules / "kubernetes-models").exists():
        print("node or kubernetes-models is missing: deploy/install_protocol_tools.sh installs it")
        sys.exit(SKIPPED)
    done = subprocess.run([node, pathlib.Path(__file__).with_name("known_to_the_api.js"), modules], input=json.dumps(objects), capture_output=True, text=True,
                          check=True, timeout=120)
    return done.stdout.splitlines()


def check_schema():
    objects = manifests.read_objects()
    complaints = unknown_to_the_api(objects)
    wrong = copy.deepcopy(objects)
    server = next(each for each in wrong if each["kind"] == "StatefulSet")
    server["spec"]["replicas"] = "3"
    server["spec"]["template"]["spec"]["containers"][0]["livenesProbe"] = {"grpc": {"port": 1}}
    server["apiVersion"] = "apps/v1"
    del server["spec"]["selector"]
    wrong.append({"apiVersion": "apps/v1", "kind": "StatefullSet", "metadata": {"name": "x"}})
    found = "\n".join(unknown_to_the_api(wrong))
    complaints += [f"nobody complains about {what}" for what in ("replicas type", "livenesProbe is no field", '"selector"', "StatefullSet x: apps/v1 has no such kind")
                   if what not in found]
    return complaints


def server_of(objects):
    return next(each for each in objects if each["kind"] == "StatefulSet")


def first(objects):
    return manifests.pod(server_of(objects))["containers"][0]


def of_name(objects, kind, name):
    return next(each for each in objects if each["kind"] == kind and each["metadata"]["name"] == name)


def gateway_of(objects):
    return of_name(objects, "Deployment", "tissueform-gateway")["spec"]["template"]["spec"]["containers"][0]


def change(words, old, new):
    words[words.index(old)] = new


LAST_NODE = "tissueform-server-7"
# What is made wrong, and a part of the complaint.
BROKEN = {
    "an option that is none": (lambda o: first(o)["args"].append("--drain-second=1"), "no option --drain-second"),
    "a variable that nobody reads": (lambda o: first(o)["env"].append({"name": "TISSUEFORM_SERVER_STOR", "value": "x"}), "does not read TISSUEFORM_SERVER_STOR"),
    "a value that is refused": (lambda o: first(o)["args"].append("--max-streams=-1"), "max-streams"),
    "another port of the program": (lambda o: change(first(o)["args"], "--port=50051", "--port=50050"), "listens on 50050"),
    "a probe of a port that is none": (lambda o: first(o)["readinessProbe"]["grpc"].update(port=50054), "asks port 50054"),
    "a service of a port that is none": (lambda o: of_name(o, "Service", "tissueform")["spec"]["ports"][0].update(targetPort="web"), "no container has a port web"),
    "a policy for a port that is none": (lambda o: of_name(o, "NetworkPolicy", "server")["spec"]["ingress"][0]["ports"][0].update(port="http"), "has no port http"),
    "a node more than they know": (lambda o: server_of(o)["spec"].update(replicas=9), "9 replicas, of which HAProxy knows 8"),
    "a gateway past HAProxy": (lambda o: change(gateway_of(o)["args"], "--server=tissueform-calls.tissueform.svc.cluster.local:50054",
                                               f"--server={LAST_NODE}.tissueform.svc.cluster.local:50051"), "--server is not the Service of HAProxy"),
    "a node that HAProxy does not know": (lambda o: of_name(o, "Deployment", "tissueform-haproxy")["spec"]["template"]["spec"]["containers"][0]["env"].remove(
        {"name": "TISSUEFORM_NODE_8", "value": LAST_NODE}), "it knows other nodes"),
    "a variable that HAProxy does not read": (lambda o: of_name(o, "Deployment", "tissueform-haproxy")["spec"]["template"]["spec"]["containers"][0]["env"].append(
        {"name": "TISSUEFORM_SERVERS", "value": "x"}), "cluster.cfg does not read TISSUEFORM_SERVERS"),
    "a node without an address": (lambda o: o.remove(of_name(o, "Service", "tissueform-server-1")), "tissueform-server-1: it has no Service"),
    "a file that no volume brings": (lambda o: first(o)["args"].append("--audit-ca=/etc/tissueform/audit/ca.pem"), "no volume brings /etc/tissueform/audit/ca.pem"),
    "a key that nobody makes": (lambda o: manifests.pod(server_of(o))["volumes"][1]["secret"]["items"][0].update(key="pasword"), "no row for pasword"),
    "too little memory": (lambda o: first(o)["resources"].update(requests={"cpu": "2", "memory": "6Gi"}, limits={"memory": "6Gi"}), "does not bear its budget"),
    "more workers than cores": (lambda o: change(first(o)["args"], "--workers=2", "--workers=4"), "4 workers on 2 cores"),
    "a privileged container": (lambda o: first(o)["securityContext"].update(privileged=True), "it has privileges"),
    "a capability": (lambda o: first(o)["securityContext"]["capabilities"].update(add=["NET_ADMIN"]), "it has privileges"),
    "root": (lambda o: manifests.pod(server_of(o))["securityContext"].pop("runAsNonRoot"), "its user or its system calls"),
    "a pod killed while it drains": (lambda o: manifests.pod(server_of(o)).update(terminationGracePeriodSeconds=30), "grace are too few"),
    "a budget that selects nothing": (lambda o: of_name(o, "PodDisruptionBudget", "tissueform-server")["spec"]["selector"].update(matchLabels={"app.kubernetes.io/name": "x"}),
                                      "it selects no pods"),
    "a secret in the files": (lambda o: o.append({"kind": "Secret"}), "a Secret stands in the files"),
    "a namespace that is open": (lambda o: o.remove(of_name(o, "NetworkPolicy", "nobody")), "no NetworkPolicy refuses"),
}


def check_broken(programs):
    complaints = []
    for what, (damage, wanted) in BROKEN.items():
        objects = manifests.read_objects()
        damage(objects)
        found = manifests.complaints(objects, programs)
        if any(wanted in line for line in found):
            print(f"ok: {what}: {next(line for line in found if wanted in line)}")
        else:
            complaints.append(f"nobody complains about {what}")
    return complaints


def make_certificates(folder):
    """One for every use, of an authority of its own."""
    names = "DNS:localhost,DNS:tissueform-server.tissueform.svc.cluster.local"
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj", "/CN=localhost",
                    "-addext", f"subjectAltName={names}", "-keyout", folder / "tls.key", "-out", folder / "tls.crt"], check=True, capture_output=True)
    shutil.copy(folder / "tls.key", folder / "tls.crt.key")
    shutil.copy(folder / "tls.crt", folder / "ca.crt")


def copy_of(name, folder, changes):
    """A configuration with the files of this machine."""
    text = (manifests.FOLDER / name).read_text()
    for old, new in {"/etc/tissueform/tls/": f"{folder}/", "/etc/tissueform/proxy/": f"{folder}/", "/run/haproxy/": f"{folder}/", **changes}.items():
        assert old in text or old.startswith("/"), f"{name} has no {old}"
        text = text.replace(old, new)
    path = folder / name
    path.write_text(text)
    return path


def environment_of_haproxy(folder):
    """That of its container, with files of this machine and addresses that it knows."""
    container = of_name(manifests.read_objects(), "Deployment", "tissueform-haproxy")["spec"]["template"]["spec"]["containers"][0]
    values = {each["name"]: each["value"] for each in container["env"]}
    for name, value in values.items():
        value = re.sub(r"^[a-z0-9-]+\.tissueform\.svc\.cluster\.local(?=:)", "127.0.0.1", value)
        values[name] = re.sub(r"^/(?:etc/tissueform/(?:tls|proxy)|run/haproxy)/", f"{folder}/", value)
    return values


def first_line(process, prefix):
    for line in process.stdout:
        if line.startswith(prefix):
            return line.removeprefix(prefix).strip()
    raise SystemExit(f"it has ended without {prefix!r}")


def ask(port, grpc, method, request=b""):
    with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                return channel.unary_unary(method)(request, timeout=5)
            except grpc.RpcError as error:
                if error.code() != grpc.StatusCode.UNAVAILABLE or time.monotonic() > end:
                    return error.code()


def check_proxies(programs):
    haproxy = shutil.which("haproxy", path="/usr/sbin:/usr/bin")
    try:
        import grpc
    except ImportError:
        grpc = None
    if haproxy is None or shutil.which("openssl") is None or grpc is None:
        print("haproxy, openssl or python3-grpcio is missing")
        sys.exit(SKIPPED)
    complaints = []
    with tempfile.TemporaryDirectory() as name, socket.create_server(("127.0.0.1", 0)) as listener:
        folder = pathlib.Path(name)
        make_certificates(folder)
        read = subprocess.run([haproxy, "-c", "-f", manifests.FOLDER / "cluster.cfg"], env=environment_of_haproxy(folder), capture_output=True, text=True, check=False,
                              timeout=60)
        if read.returncode != 0 or "WARNING" in read.stderr:
            complaints.append(f"HAProxy does not like cluster.cfg: {read.stderr}")
        server = subprocess.Popen([programs / "tissueform-server", "--in-memory", "--host", "127.0.0.1", "--port", "0", "--tls-cert", folder / "tls.crt",
                                   "--tls-key", folder / "tls.key", "--log-level", "warn"], stdout=subprocess.PIPE, text=True)
        proxy = None
        try:
            port = first_line(server, "listening on 127.0.0.1:")
            health = copy_of("health.cfg", folder, {":50053": f"fd@{listener.fileno()}", "127.0.0.1:50051": f"127.0.0.1:{port}"})
            proxy = subprocess.Popen([haproxy, "-db", "-f", health], pass_fds=[listener.fileno()])
            probed = listener.getsockname()[1]
            services = {container[probe]["grpc"].get("service", "") for _, container in manifests.containers(manifests.read_objects())
                        for probe in ("startupProbe", "livenessProbe", "readinessProbe") if "grpc" in container.get(probe, {})}
            for service in services:
                request = bytes([10, len(service)]) + service.encode() if service else b""
                if (answer := ask(probed, grpc, "/grpc.health.v1.Health/Check", request)) != b"\x08\x01":
                    complaints.append(f"a probe does not hear that {service!r} serves, but {answer}")
            if (answer := ask(probed, grpc, "/tissueform.v1.ServerInfoService/GetServerInfo")) != grpc.StatusCode.PERMISSION_DENIED:
                complaints.append(f"what is no probe comes through: {answer}")
        finally:
            for process in (proxy, server):
                if process is not None:
                    process.terminate()
                    process.wait(PATIENCE_S)
    return complaints


def main(words):
    programs = pathlib.Path(words[1]).resolve() if len(words) == 2 else None
    checks = {"schema": check_schema, "programs": lambda: manifests.complaints(manifests.read_objects(), programs), "broken": lambda: check_broken(programs),
              "proxies": lambda: check_proxies(programs)}
    if not words or words[0] not in checks or (words[0] != "schema" and programs is None):
        print(__doc__, file=sys.stderr)
        return 2
    found = checks[words[0]]()
    print("\n".join(found) if found else "ok")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
