#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""deploy/compose.yaml is what Compose knows, and fits the programs.

    tests/scripts/check_compose.py FOLDER_OF_PROGRAMS

Debian's docker-compose judges the form, with and without the profile `postgresql`; it needs no container engine for that. The
programs take the options, on the ports that are published, within the memory and the time that their containers have.
Health checks run against the programs, up and down. Copies with faults are complained about. Exit code 0 when all is so.
"""

import copy
import os
import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import time

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
FILE = ROOT / "deploy/compose.yaml"
PATIENCE_S = 60
MIB = {"m": 1, "g": 1024}
NAMES = {"server": "tissueform-server", "gateway": "tissueform-gateway"}


def run(*words, env=None):
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=PATIENCE_S, env=os.environ | (env or {}))


def compose_faults(objects, profiles):
    """What docker-compose has to say about the form."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "compose.yaml"
        file.write_text(yaml.safe_dump(objects), encoding="utf-8")
        done = run("docker-compose", "--file", file, "config", "--quiet", env={"COMPOSE_PROFILES": profiles})
    return done.stderr.split("\n")[:3] if done.returncode != 0 else []


def options_of(programs, name, service, env=None):
    """(options as --print-config writes them, faults)."""
    done = run(programs / NAMES[name], *service["command"], "--print-config", env=env)
    if done.returncode != 0:
        return {}, [f"{name}: {NAMES[name]} refuses its command: {done.stderr.strip()}"]
    return dict(re.findall(r"^([a-z-]+) = (.*)$", done.stdout, re.MULTILINE)), []


def port_faults(name, service, listening):
    for published in service.get("ports", []):
        address, _, inner = published.rpartition(":")
        if not address.startswith("127.0.0.1:"):
            yield f"{name}: port {published} is open to the network"
        if inner != listening:
            yield f"{name}: port {published} is published, but the program listens on {listening}"
    if f"/127.0.0.1/{listening}" not in service["healthcheck"]["test"][-1]:
        yield f"{name}: the health check asks another port than {listening}"


def limit_mib(service):
    amount, unit = re.fullmatch(r"(\d+)([mg])", service["mem_limit"]).groups()
    return int(amount) * MIB[unit]


def server_faults(programs, objects):
    service = objects["services"]["server"]
    options, faults = options_of(programs, "server", service)
    if faults:
        return faults
    faults += port_faults("server", service, options["port"])
    needed = int(options["memory-budget-mib"]) * 1.1 + 512
    if limit_mib(service) < needed + 256:
        faults.append(f"server: {limit_mib(service)} MiB are too few for {needed:.0f} MiB and the program")
    if int(service["stop_grace_period"].rstrip("s")) <= int(options["drain-seconds"]):
        faults.append("server: it is killed before it has drained")
    folder = re.search(r"^VOLUME (\S+)$", (ROOT / "Dockerfile").read_text(encoding="utf-8"), re.MULTILINE)[1]
    if [each.split(":")[1] for each in service["volumes"]] != [folder]:
        faults.append(f"server: the image keeps its data in {folder}")
    return faults


def gateway_faults(programs, objects):
    service = objects["services"]["gateway"]
    options, faults = options_of(programs, "gateway", service)
    if faults:
        return faults
    faults += port_faults("gateway", service, options["listen"].rpartition(":")[2])
    host, _, port = options["server"].strip('"[]').rpartition(":")
    ports = [each.rpartition(":")[2] for each in objects["services"].get(host, {}).get("ports", [])]
    if port not in ports:
        faults.append(f"gateway: no service answers at {options['server']}")
    return faults


def database_faults(programs, objects):
    """The address that the file recommends is that of the database in it, and the server takes it."""
    database = objects["services"]["database"]
    url = re.search(r"TISSUEFORM_SERVER_STORE=(\S+)", FILE.read_text(encoding="utf-8"))[1]
    user, host, name = re.fullmatch(r"postgresql://(\w+)@(\w+):5432/(\w+)", url).groups()
    faults = [] if host in objects["services"] else [f"no service is named {host}"]
    faults += [f"database: {key} is not {value}, as {url} says" for key, value in (("POSTGRES_USER", user), ("POSTGRES_DB", name))
               if database["environment"].get(key) != value]
    server = objects["services"]["server"]
    faults += [f"server: {key} is not passed on" for key in ("TISSUEFORM_SERVER_STORE", "TISSUEFORM_STORE_PASSWORD") if key not in server["environment"]]
    options, refused = options_of(programs, "server", server, {"TISSUEFORM_SERVER_STORE": url})
    # Printed without the user.
    if options.get("store") != url.replace(f"{user}@", "HIDDEN@"):
        faults += refused or [f"server: it does not take {url}"]
    # 2: no server answers here; 3 would be options that it does not know.
    if run(*database["healthcheck"]["test"][1:], "--host", "127.0.0.1", "--port", "1").returncode != 2:
        faults.append("database: pg_isready does not know the options of its health check")
    return faults


def faults_of(programs, objects):
    found = [fault for profiles in ("", "postgresql") for fault in compose_faults(objects, profiles)]
    return found or [*server_faults(programs, objects), *gateway_faults(programs, objects), *database_faults(programs, objects)]


class Started:
    """A program of a service on a free port of loopback; `port` is that port."""

    def __init__(self, program, *words):
        self.process = subprocess.Popen([program, *words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        line = self.process.stdout.readline()
        if not line.startswith("listening on "):
            raise RuntimeError(f"{program} does not start")
        self.port = line.strip().rpartition(":")[2].rstrip("/")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(timeout=PATIENCE_S)
        self.process.stdout.close()


def is_healthy(service, port):
    # $$ is a $ in Compose's files.
    words = [word.replace("$$", "$") for word in service["healthcheck"]["test"][1:]]
    words[-1] = re.sub(r"(/127\.0\.0\.1/)\d+", rf"\g<1>{port}", words[-1])
    return run(*words).returncode == 0


def becomes_healthy(service, port):
    """Compose asks again as well: a gateway listens before it has reached its server."""
    end = time.monotonic() + PATIENCE_S
    while not is_healthy(service, port):
        if time.monotonic() > end:
            return False
        time.sleep(0.1)
    return True


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return str(probe.getsockname()[1])


def health_faults(programs, objects):
    services = objects["services"]
    with tempfile.TemporaryDirectory() as web:
        (pathlib.Path(web) / "index.html").write_text("<!doctype html>", encoding="utf-8")
        gateway_words = ("--listen", "127.0.0.1:0", "--web", web, "--server")
        with Started(programs / NAMES["server"], "--in-memory", "--port", "0") as server:
            with Started(programs / NAMES["gateway"], *gateway_words, f"127.0.0.1:{server.port}") as gateway:
                if not becomes_healthy(services["server"], server.port) or not becomes_healthy(services["gateway"], gateway.port):
                    yield "a health check fails on a healthy program"
        with Started(programs / NAMES["gateway"], *gateway_words, f"127.0.0.1:{free_port()}") as gateway:
            if is_healthy(services["gateway"], gateway.port):
                yield "a gateway without a server passes its health check"
    if is_healthy(services["server"], server.port):
        yield "a server that has ended passes its health check"


def unnoticed(programs, objects):
    """Faults that the rules above do not see."""
    def server(copied):
        return copied["services"]["server"]

    changes = {
        "a port that is open to the network": lambda all_of: server(all_of).update(ports=["50051:50051"]),
        "another port": lambda all_of: server(all_of).update(ports=["127.0.0.1:50051:50052"]),
        "an unknown option": lambda all_of: server(all_of)["command"].append("--no-such-option"),
        "too little memory": lambda all_of: server(all_of).update(mem_limit="4g"),
        "a short grace period": lambda all_of: server(all_of).update(stop_grace_period="10s"),
        "another data folder": lambda all_of: server(all_of).update(volumes=["data:/data"]),
        "an unknown key": lambda all_of: server(all_of).update(healtcheck={}),
        "an unknown service": lambda all_of: all_of["services"]["gateway"].update(depends_on={"serwer": {"condition": "service_healthy"}}),
        "a server elsewhere": lambda all_of: all_of["services"]["gateway"]["command"].__setitem__(1, "server:50052"),
        "another database": lambda all_of: all_of["services"]["database"]["environment"].update(POSTGRES_DB="other"),
        "a volume that is not declared": lambda all_of: all_of["volumes"].pop("database"),
    }
    for what, change in changes.items():
        broken = copy.deepcopy(objects)
        change(broken)
        if not faults_of(programs, broken):
            yield f"{what} is not noticed"


def main(programs):
    objects = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    found = [*faults_of(programs, objects), *health_faults(programs, objects)] or list(unnoticed(programs, objects))
    print("\n".join(found) if found else "deploy/compose.yaml fits the programs")
    return 1 if found else 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    try:
        sys.exit(main(pathlib.Path(sys.argv[1]).resolve()))
    except (OSError, RuntimeError) as error:
        print(f"check_compose.py: {error}", file=sys.stderr)
        sys.exit(1)
