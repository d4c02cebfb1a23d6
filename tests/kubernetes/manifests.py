# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The objects of deploy/kubernetes, and what is to be true of them. Each rule gives its complaints, one line each."""

import pathlib
import re
import subprocess

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDER = ROOT / "deploy/kubernetes"
PROGRAMS = ("tissueform-server", "tissueform-gateway")
MOST_NODES = 8  # as many as deploy/haproxy/cluster.cfg has places for
# Beside the budget: gRPC's own buffers (docs/operations.md), the program, and a tenth for the allocator's slack.
GRPC_MIB, PROGRAM_MIB, SLACK = 512, 128, 1.1
# Files of the image that arguments may name, and what puts them there.
OF_THE_PACKAGES = {"/usr/share/tissueform/web": "deploy/build_packages.sh"}


def read_objects():
    """All objects that kustomization.yaml names."""
    kustomization = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())
    return [each for file in kustomization["resources"] for each in yaml.safe_load_all((FOLDER / file).read_text())]


def generated_files():
    """ConfigMap to the files of which kustomize makes it."""
    kustomization = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())
    return {each["name"]: set(each["files"]) for each in kustomization["configMapGenerator"]}


def of_kind(objects, *kinds):
    return [each for each in objects if each["kind"] in kinds]


def workloads(objects):
    return of_kind(objects, "StatefulSet", "Deployment")


def pod(workload):
    return workload["spec"]["template"]["spec"]


def containers(objects):
    for workload in workloads(objects):
        for container in pod(workload)["containers"]:
            yield workload, container


def name_of(workload, container):
    return f"{workload['metadata']['name']}/{container['name']}"


def arguments(container):
    """Option to its values."""
    values = {}
    for word in container.get("args", []):
        option, _, value = word.removeprefix("--").partition("=")
        values.setdefault(option, []).append(value)
    return values


def environment(objects, container):
    """Names of the container's environment, those of its ConfigMaps included."""
    names = [each["name"] for each in container.get("env", [])]
    maps = {each["metadata"]["name"]: each["data"] for each in of_kind(objects, "ConfigMap")}
    for source in container.get("envFrom", []):
        names += maps.get(source["configMapRef"]["name"], {"(a ConfigMap that is missing)": ""})
    return names


def mebibytes(quantity):
    amount, unit = re.fullmatch(r"(\d+)(Mi|Gi)", quantity).groups()
    return int(amount) * (1024 if unit == "Gi" else 1)


def cores(quantity):
    return int(quantity[:-1]) / 1000 if quantity.endswith("m") else float(quantity)


def unknown_options(objects, programs):
    """Options and variables that a program does not have, by what it says of itself."""
    for workload, container in containers(objects):
        program = container["command"][0]
        if program not in PROGRAMS:
            continue
        said = subprocess.run([programs / program, "--help"], capture_output=True, text=True, check=True, timeout=60).stdout
        options, variables = set(re.findall(r"--([a-z][a-z-]*)", said)), set(re.findall(r"Env:(\w+)", said))
        for option in arguments(container):
            if option not in options:
                yield f"{name_of(workload, container)}: {program} has no option --{option}"
        for variable in environment(objects, container):
            if variable not in variables | {"POD_NAME", "TMPDIR"}:
                yield f"{name_of(workload, container)}: {program} does not read {variable}"


def refused_values(objects, programs):
    """Values that a program does not print back as its own."""
    for workload, container in containers(objects):
        program = container["command"][0]
        if program not in PROGRAMS:
            continue
        words = [word.replace("$(POD_NAME)", "tissueform-server-0") for word in container["args"]]
        done = subprocess.run([programs / program, *words, "--print-config"], capture_output=True, text=True, check=False, timeout=60,
                              env={"TISSUEFORM_SERVER_STORE": "postgresql://tissueform@database:5432/tissueform"})
        if done.returncode != 0:
            yield f"{name_of(workload, container)}: {done.stderr.strip()}"
            continue
        for option, values in arguments(container).items():
            line = next((line for line in done.stdout.splitlines() if line.startswith(f"{option} = ")), "")
            if not all(value.replace("$(POD_NAME)", "tissueform-server-0") in line for value in values):
                yield f"{name_of(workload, container)}: --{option} is {line!r}, not {values}"


def wrong_ports(objects):
    """Ports that nobody listens on."""
    services = {each["metadata"]["name"]: each for each in of_kind(objects, "Service")}
    by_labels = {}
    for workload in workloads(objects):
        ports = {each["name"]: each["containerPort"] for each_container in pod(workload)["containers"] for each in each_container["ports"]}
        by_labels[workload["spec"]["template"]["metadata"]["labels"]["app.kubernetes.io/name"]] = ports
        for container in pod(workload)["containers"]:
            own, given = {each["containerPort"] for each in container["ports"]}, arguments(container)
            listened = given.get("port", []) + given.get("listen", [])
            listened += [each["value"] for each in container.get("env", []) if each["name"].startswith("TISSUEFORM_LISTEN")]
            if listened and own != {int(value.rpartition(":")[2]) for value in listened}:
                yield f"{name_of(workload, container)}: listens on {' and '.join(listened)}, its ports are {sorted(own)}"
            for kind in ("startupProbe", "livenessProbe", "readinessProbe"):
                probe = container.get(kind)
                if probe is None:
                    continue
                port = next(probe[how]["port"] for how in ("grpc", "httpGet", "tcpSocket") if how in probe)
                if port not in ports and port not in ports.values():
                    yield f"{name_of(workload, container)}: {kind} asks port {port}, which nobody has"
    for name, service in services.items():
        ports = by_labels.get(service["spec"]["selector"]["app.kubernetes.io/name"], {})
        for each in service["spec"]["ports"]:
            if each["targetPort"] not in ports:
                yield f"Service {name}: no container has a port {each['targetPort']}"
    for policy in of_kind(objects, "NetworkPolicy"):
        own = policy["spec"]["podSelector"].get("matchLabels", {}).get("app.kubernetes.io/name")
        rules = [(own, rule) for rule in policy["spec"].get("ingress", [])]
        for rule in policy["spec"].get("egress", []):
            rules += [(peer["podSelector"]["matchLabels"]["app.kubernetes.io/name"], rule) for peer in rule["to"] if "podSelector" in peer]
        for label, rule in rules:
            for port in rule["ports"]:
                if port["port"] not in by_labels.get(label, {}):
                    yield f"NetworkPolicy {policy['metadata']['name']}: {label} has no port {port['port']}"


def unknown_servers(objects):
    """Nodes that HAProxy or Services leave out of those that there are and may be: a node is added by `replicas` alone."""
    server = next(each for each in workloads(objects) if each["kind"] == "StatefulSet")
    name, port = server["metadata"]["name"], arguments(pod(server)["containers"][0])["port"][0]
    wanted = {node: f"{node}.tissueform.svc.cluster.local:{port}" for node in (f"{name}-{i}" for i in range(MOST_NODES))}
    replicas = server["spec"]["replicas"]
    if isinstance(replicas, int) and replicas > MOST_NODES:
        yield f"{name}: {replicas} replicas, of which HAProxy knows {MOST_NODES}"
    by_program = {container["command"][0]: container for _, container in containers(objects) if container["name"] != "health"}
    given = {each["name"]: each["value"] for each in by_program["haproxy"]["env"]}
    if {given[f"TISSUEFORM_NODE_{i}"]: given.get(f"TISSUEFORM_SERVER_{i}") for i in range(1, MOST_NODES + 1) if f"TISSUEFORM_NODE_{i}" in given} != wanted:
        yield f"tissueform-haproxy: it knows other nodes than {list(wanted)}"
    services = {each["metadata"]["name"]: each["spec"] for each in of_kind(objects, "Service")}
    for node in wanted:
        if services.get(node, {}).get("selector", {}).get("statefulset.kubernetes.io/pod-name") != node:
            yield f"{node}: it has no Service"
    for each in given.values():
        if (found := re.fullmatch(r"([a-z0-9-]+)\.tissueform\.svc\.cluster\.local(?::(\d+))?", each)) and (
                found.group(1) not in services or int(found.group(2) or 50051) not in {port["port"] for port in services[found.group(1)]["ports"]}):
            yield f"tissueform-haproxy: there is no Service {each}"
    calls = next((each for each in services.values() if any(port["name"] == "calls" for port in each["ports"])), {"ports": [{}]})
    if arguments(by_program["tissueform-gateway"])["server"] != [f"tissueform-calls.tissueform.svc.cluster.local:{calls['ports'][0].get('port')}"]:
        yield "tissueform-gateway: --server is not the Service of HAProxy for the calls of gateways"
    configuration = (FOLDER / "cluster.cfg").read_text()
    if configuration != (ROOT / "deploy/haproxy/cluster.cfg").read_text():
        yield "cluster.cfg: it is not deploy/haproxy/cluster.cfg"
    asked = set(re.findall(r"TISSUEFORM_[A-Z_]+(?:[0-9])?", configuration))
    for variable in given:
        if variable not in asked:
            yield f"tissueform-haproxy: cluster.cfg does not read {variable}"


def missing_files(objects):
    """Files that no volume brings, and keys of Secrets that README.md does not say how to make."""
    readme = (FOLDER / "README.md").read_text()
    generated = generated_files()
    for workload, container in containers(objects):
        volumes = {each["name"]: each for each in pod(workload)["volumes"]}
        present, folders = set(OF_THE_PACKAGES), []
        for mount in container.get("volumeMounts", []):
            volume = volumes.get(mount["name"], {})
            source = volume.get("secret") or volume.get("configMap")
            folders.append(mount["mountPath"])
            for item in source["items"] if source else []:
                present.add(f"{mount['mountPath']}/{item['path']}")
                if "secret" in volume and f"`{source['secretName']}` | `{item['key']}`" not in readme.replace("\n| | `", f"\n| `{source['secretName']}` | `"):
                    yield f"{name_of(workload, container)}: README.md has no row for {item['key']} of Secret {source['secretName']}"
                if "configMap" in volume and item["key"] not in generated.get(source["name"], ()):
                    yield f"{name_of(workload, container)}: kustomization.yaml makes no {item['key']}"
        configurations = [FOLDER / word.removeprefix("/etc/haproxy/") for word in container["command"] if word.endswith(".cfg")]
        text = " ".join([*container["command"], *container.get("args", []), *(f" {each['value']}" for each in container.get("env", []) if "value" in each), *(re.sub(r"(?m)#.*$", "", file.read_text()) for file in configurations)])
        for path in set(re.findall(r"(?<=[ =])/(?:etc|usr|run)/[\w./-]+", text)):
            if path not in present and not (path.startswith("/run/") and any(path.startswith(f"{folder}/") for folder in folders)):
                yield f"{name_of(workload, container)}: no volume brings {path}"
        for each in container.get("env", []):
            reference = each.get("valueFrom", {}).get("secretKeyRef")
            if reference and f"`{reference['name']}` | `{reference['key']}`" not in readme:
                yield f"{name_of(workload, container)}: README.md has no row for {reference['key']} of Secret {reference['name']}"


def too_little_memory(objects):
    """Containers without limits, and a memory budget that the limit does not bear."""
    for workload, container in containers(objects):
        requests, limits = container["resources"]["requests"], container["resources"]["limits"]
        if requests["memory"] != limits["memory"]:
            yield f"{name_of(workload, container)}: memory that is asked for is not the limit: others could take it"
        given = arguments(container)
        if "memory-budget-mib" in given:
            needed = (int(given["memory-budget-mib"][0]) * SLACK) + GRPC_MIB + PROGRAM_MIB
            if mebibytes(limits["memory"]) < needed:
                yield f"{name_of(workload, container)}: a limit of {limits['memory']} does not bear its budget, which takes {needed:.0f} MiB"
        if "workers" in given and int(given["workers"][0]) != cores(requests["cpu"]):
            yield f"{name_of(workload, container)}: {given['workers'][0]} workers on {requests['cpu']} cores"


def privileges(objects):
    """What a pod may do that it need not."""
    for workload in workloads(objects):
        name, spec = workload["metadata"]["name"], pod(workload)
        context = spec.get("securityContext", {})
        if not context.get("runAsNonRoot") or not context.get("runAsUser") or context.get("seccompProfile") != {"type": "RuntimeDefault"}:
            yield f"{name}: its user or its system calls are not limited"
        if spec.get("automountServiceAccountToken", True):
            yield f"{name}: it can speak with the API server"
        if spec.get("enableServiceLinks", True):
            yield f"{name}: addresses of services become options"
        for field in ("hostNetwork", "hostPID", "hostIPC"):
            if spec.get(field):
                yield f"{name}: {field}"
        if any("hostPath" in volume for volume in spec["volumes"]):
            yield f"{name}: it sees files of the machine"
    for workload, container in containers(objects):
        context = container.get("securityContext", {})
        if (context.get("allowPrivilegeEscalation") is not False or context.get("readOnlyRootFilesystem") is not True or context.get("privileged")
                or context.get("capabilities") != {"drop": ["ALL"]} or set(context) - {"allowPrivilegeEscalation", "readOnlyRootFilesystem", "capabilities"}):
            yield f"{name_of(workload, container)}: it has privileges"
        for kind in ("startupProbe", "livenessProbe", "readinessProbe"):
            if kind not in container and container["name"] != "health":
                yield f"{name_of(workload, container)}: it has no {kind}"


def short_grace(objects):
    """Pods that are killed while they drain."""
    for workload, container in containers(objects):
        given, grace = arguments(container), pod(workload)["terminationGracePeriodSeconds"]
        drain = int(given.get("drain-seconds", ["0"])[0])
        # The gateway waits three times as long at most; the server as long again for what cannot be cancelled at once.
        needed = drain * (3 if container["command"][0] == "tissueform-gateway" else 2)
        waits = re.search(r"sleep (\d+)$", " ".join(container.get("lifecycle", {}).get("preStop", {}).get("exec", {}).get("command", [])))
        if grace <= needed + (int(waits.group(1)) if waits else 0):
            yield f"{name_of(workload, container)}: {grace} s of grace are too few for a drain of {drain} s"
        if "preStop" not in container.get("lifecycle", {}):
            yield f"{name_of(workload, container)}: nothing is done before it ends"


def loose_ends(objects):
    """Labels that select nothing, secrets that stand in the files, a namespace that is open."""
    labels = [workload["spec"]["template"]["metadata"]["labels"] for workload in workloads(objects)]
    # Kubernetes labels the pods of a StatefulSet with their names.
    labels += [each["spec"]["template"]["metadata"]["labels"] | {"statefulset.kubernetes.io/pod-name": f"{each['metadata']['name']}-{i}"}
               for each in of_kind(objects, "StatefulSet") for i in range(MOST_NODES)]
    for each in of_kind(objects, "Service", "PodDisruptionBudget", "NetworkPolicy", "StatefulSet", "Deployment"):
        spec = each["spec"]
        selector = spec.get("podSelector", spec.get("selector", {}))
        selector = selector.get("matchLabels", {} if "podSelector" in spec else selector)
        if not any(selector.items() <= some.items() for some in labels):
            yield f"{each['kind']} {each['metadata']['name']}: it selects no pods"
    for workload in workloads(objects):
        some = workload["spec"]["template"]["metadata"]["labels"].items()
        for kind in ("PodDisruptionBudget", "NetworkPolicy"):
            chosen = [each["spec"].get("podSelector", each["spec"].get("selector"))["matchLabels"] for each in of_kind(objects, kind)
                      if each["spec"].get("podSelector", each["spec"].get("selector"))]
            if not any(each.items() <= some for each in chosen):
                yield f"{workload['metadata']['name']}: it has no {kind}"
    if of_kind(objects, "Secret"):
        yield "a Secret stands in the files"
    everybody = [each for each in of_kind(objects, "NetworkPolicy") if each["spec"]["podSelector"] == {} and "ingress" not in each["spec"] and "egress" not in each["spec"]]
    if not everybody:
        yield "no NetworkPolicy refuses what none allows"


def complaints(objects, programs):
    rules = (wrong_ports, unknown_servers, missing_files, too_little_memory, privileges, short_grace, loose_ends)
    return [line for rule in rules for line in rule(objects)] + [line for rule in (unknown_options, refused_values) for line in rule(objects, programs)]
