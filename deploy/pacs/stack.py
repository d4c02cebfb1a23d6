# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Orthanc with DICOMweb, tissueform-server, tissueform-gateway and tissueform-pacs on this machine's loopback, with TLS
between them by an authority that is thrown away: what demo.py shows and tests/pacs/roundtrip.py tries.

All that is started is ended by its process id.
"""

import glob
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import time
import urllib.parse
import urllib.request

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1]))
from free_ports import free_ports

PATIENCE_S = 60
HOST = "127.0.0.1"
SCANNER, BRIDGE, ORTHANC = "SCANNER", "TISSUEFORM", "ORTHANC"
NEEDED = ["openssl", "storescu", "dciodvfy", "haproxy"]
# DCMTK, which Orthanc is made with, takes 22 slices a second otherwise: it waits for acknowledgements of small pieces.
QUICK = os.environ | {"TCP_NODELAY": "1"}
SYSTEM_PATH = "/usr/sbin:/usr/bin:/usr/local/sbin"


def orthanc_program():
    """Path of Orthanc; None where it is not installed."""
    return shutil.which("Orthanc", path=SYSTEM_PATH)


def dicomweb_plugin():
    found = sorted(glob.glob("/usr/lib/orthanc/libOrthancDicomWeb.so*") + glob.glob("/usr/share/orthanc/plugins/libOrthancDicomWeb.so*"))
    return found[0] if found else None


def missing_programs():
    """What of others' is not installed, for a sentence; empty: nothing."""
    missing = [name for name in NEEDED if shutil.which(name, path=SYSTEM_PATH) is None]
    if orthanc_program() is None:
        missing.append("orthanc")
    if dicomweb_plugin() is None:
        missing.append("orthanc-dicomweb")
    return missing


def children_of(process):
    """Pids of all that a process has started, and of what those have."""
    found = [int(pid) for path in pathlib.Path(f"/proc/{process}/task").glob("*/children") for pid in path.read_text().split()]
    return found + [pid for child in found for pid in children_of(child)]


def state_of(pid):
    """The letter of /proc: "T" is stopped, "Z" ended and not asked for; empty: there is none."""
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return ""


def runs(pid):
    """Not ended, or ended and not asked for."""
    return state_of(pid) not in ("", "Z")


def most_memory_mib(pid):
    """The most that was resident so far."""
    return int(re.search(r"VmHWM:\s+(\d+) kB", pathlib.Path(f"/proc/{pid}/status").read_text()).group(1)) / 1024


class Authority:
    """An authority of certificates that nobody else trusts, in a folder."""

    def __init__(self, folder, name="Tissueform demo authority"):
        self.folder = pathlib.Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.certificate, self.key = self.folder / "ca.pem", self.folder / "ca.key"
        self._openssl("req", "-x509", *self._new_key(), "-days", "2", "-subj", f"/CN={name}", "-addext", "basicConstraints=critical,CA:TRUE",
                      "-addext", "keyUsage=critical,keyCertSign,cRLSign", "-keyout", self.key, "-out", self.certificate)

    @staticmethod
    def _new_key():
        return ["-newkey", "rsa:2048", "-nodes"]

    @staticmethod
    def _openssl(*words):
        subprocess.run(["openssl", *map(str, words)], check=True, capture_output=True, timeout=PATIENCE_S)

    def issue(self, name, days=2):
        """Certificate and key of a program on loopback; with a negative number of days it has expired."""
        certificate, key, request, extensions = (self.folder / f"{name}.{end}" for end in ("pem", "key", "csr", "ext"))
        extensions.write_text("subjectAltName=DNS:localhost,IP:127.0.0.1\nextendedKeyUsage=serverAuth,clientAuth\n")
        self._openssl("req", "-new", *self._new_key(), "-subj", f"/CN={name}", "-keyout", key, "-out", request)
        self._openssl("x509", "-req", "-in", request, "-CA", self.certificate, "-CAkey", self.key, "-CAcreateserial", "-days", days,
                      "-extfile", extensions, "-out", certificate)
        key.chmod(0o600)
        return certificate, key


class Stack:
    """Orthanc, HAProxy before it, and three programs of ours in one folder. Call end(), or use it as a context."""

    def __init__(self, programs, folder, recipe, quiet_s=5, plan_threads=0, by_web=True):
        self.programs, self.folder = pathlib.Path(programs), pathlib.Path(folder)
        self.recipe, self.quiet_s, self.plan_threads = recipe, quiet_s, plan_threads
        self.by_web = by_web
        self.bridge_program, self.environment = self.programs / "tissueform-pacs", QUICK
        self.folder.mkdir(parents=True, exist_ok=True)
        self.running = {}
        self.authority = Authority(self.folder / "tls")
        self.identities = {name: self.authority.issue(name) for name in ("orthanc", "server", "bridge", "scanner", "gateway")}
        (self.orthanc_http, self.orthanc_https, self.orthanc_dicom, self.server_port, self.bridge_dicom, self.review_port,
         self.gateway_port) = free_ports(7)
        self.context = ssl.create_default_context(cafile=str(self.authority.certificate))
        self.context.load_cert_chain(*map(str, self.identities["scanner"]))
        self.dicomweb = f"https://localhost:{self.orthanc_https}/dicom-web"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()

    def log(self, name):
        return self.folder / f"{name}.log"

    def start(self, name, command):
        with open(self.log(name), "ab") as log:
            process = subprocess.Popen(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=self.folder, env=self.environment)
        self.running[name] = process
        return process

    def wait_for(self, what, check, patience_s=PATIENCE_S, needs=None):
        """Asks until it is true; a program that ends meanwhile is an error."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            answer = check()
            if answer:
                return answer
            if needs is not None and self.running[needs].poll() is not None:
                break
            time.sleep(0.1)
        tail = "" if needs is None else self.log(needs).read_text(errors="replace")[-2000:]
        raise SystemExit(f"{what}: it did not come\n{tail}")

    def stop(self, name, how=signal.SIGTERM):
        process = self.running.pop(name, None)
        if process is None:
            return
        if process.poll() is None:
            process.send_signal(how)
        try:
            process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def end(self):
        for name in reversed(list(self.running)):
            self.stop(name)

    # Orthanc

    def orthanc_settings(self):
        certificate, key = self.identities["orthanc"]
        data = str(self.folder / "orthanc")
        return {
            "Name": "tissueform", "StorageDirectory": data, "IndexDirectory": data, "StableAge": 1, "OverwriteInstances": False,
            "Plugins": [dicomweb_plugin()], "DicomWeb": {"Enable": True, "Root": "/dicom-web/", "Ssl": True},
            # This machine alone; HAProxy stands before it.
            "RemoteAccessAllowed": False, "AuthenticationEnabled": False, "HttpPort": self.orthanc_http,
            "DicomAet": ORTHANC, "DicomPort": self.orthanc_dicom, "DicomCheckCalledAet": True, "DicomAlwaysAllowGet": True,
            "DicomTlsEnabled": True, "DicomTlsCertificate": str(certificate), "DicomTlsPrivateKey": str(key),
            "DicomTlsTrustedCertificates": str(self.authority.certificate), "DicomTlsRemoteCertificateRequired": True,
            "DicomModalities": {"bridge": {"AET": BRIDGE, "Host": HOST, "Port": self.bridge_dicom, "UseDicomTls": True},
                                "scanner": {"AET": SCANNER, "Host": HOST, "Port": 4}},
        }

    def start_proxy(self):
        """TLS, and only for who has a certificate: Debian 12's Orthanc ends at its first HTTPS request."""
        certificate, key = self.identities["orthanc"]
        both = self.folder / "tls" / "orthanc-both.pem"
        both.write_text(certificate.read_text() + key.read_text())
        both.chmod(0o600)
        settings = self.folder / "haproxy.cfg"
        settings.write_text(f"""global
    ssl-default-bind-options ssl-min-ver TLSv1.2
defaults
    mode http
    timeout connect 5s
    timeout client 60s
    timeout server 60s
frontend dicomweb
    bind {HOST}:{self.orthanc_https} ssl crt {both} ca-file {self.authority.certificate} verify required
    default_backend orthanc
backend orthanc
    server orthanc {HOST}:{self.orthanc_http}
""")
        self.start("haproxy", [shutil.which("haproxy", path=SYSTEM_PATH), "-db", "-f", settings])
        self.wait_for("HAProxy", lambda: self.listens(self.orthanc_https), needs="haproxy")

    def start_orthanc(self):
        settings = self.folder / "orthanc.json"
        settings.write_text(json.dumps(self.orthanc_settings(), indent=2))
        if "haproxy" not in self.running:
            self.start_proxy()
        self.start("orthanc", [orthanc_program(), settings])
        self.wait_for("Orthanc", lambda: self.orthanc("/system", quiet=True), needs="orthanc")

    def orthanc(self, path, body=None, quiet=False, method=None):
        """What Orthanc's own interface answers; None where it does not, if that may be."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(f"https://localhost:{self.orthanc_https}{path}", data=data, method=method)
        try:
            with urllib.request.urlopen(request, context=self.context, timeout=PATIENCE_S) as reply:
                return json.loads(reply.read() or b"null")
        except (OSError, ValueError):
            if quiet:
                return None
            raise

    def orthanc_file(self, instance):
        """The bytes of an object as Orthanc keeps it."""
        url = f"https://localhost:{self.orthanc_https}/instances/{instance}/file"
        with urllib.request.urlopen(url, context=self.context, timeout=PATIENCE_S) as reply:
            return reply.read()

    def instances_of(self, study_uid, modality=None):
        """Orthanc's names of the objects of a study."""
        query = {"Level": "Instance", "Query": {"StudyInstanceUID": study_uid}}
        if modality:
            query["Query"]["Modality"] = modality
        return self.orthanc("/tools/find", query)

    def store_from_scanner(self, folder, extra=()):
        """A modality that sends a study to the PACS."""
        certificate, key = self.identities["scanner"]
        return subprocess.run(["storescu", "--aetitle", SCANNER, "--call", ORTHANC, "--enable-tls", key, certificate, "--add-cert-file",
                               self.authority.certificate, "--scan-directories", *extra, HOST, str(self.orthanc_dicom), folder],
                              capture_output=True, text=True, timeout=PATIENCE_S, env=QUICK, check=False)

    def send_to_bridge(self, study_uid):
        """As a rule of the PACS would."""
        found = self.orthanc("/tools/find", {"Level": "Study", "Query": {"StudyInstanceUID": study_uid}})
        return self.orthanc("/modalities/bridge/store", {"Resources": found, "Synchronous": True})

    # Ours

    def start_server(self, more=()):
        certificate, key = self.identities["server"]
        self.start("server", [self.programs / "tissueform-server", "--port", self.server_port, "--data-dir", self.folder / "server",
                              "--tls-cert", certificate, "--tls-key", key, "--tls-client-ca", self.authority.certificate, *more])
        self.wait_for("the server", lambda: self.listens(self.server_port), needs="server")

    @staticmethod
    def listens(port):
        try:
            with socket.create_connection((HOST, port), timeout=1):
                return True
        except OSError:
            return False

    def connection(self, name):
        """Options by which a command speaks with the server."""
        certificate, key = self.identities[name]
        return ["--server", f"localhost:{self.server_port}", "--tls-ca", self.authority.certificate, "--tls-cert", certificate, "--tls-key", key]

    def tissueform(self, *words, identity="scanner"):
        command = [self.programs / "tissueform", *words, *self.connection(identity)]
        return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=5 * PATIENCE_S, check=False)

    def start_gateway(self, web):
        certificate, key = self.identities["gateway"]
        self.start("gateway", [self.programs / "tissueform-gateway", "--listen", f"{HOST}:{self.gateway_port}", "--server", f"localhost:{self.server_port}",
                               "--server-ca", self.authority.certificate, "--cert", certificate, "--key", key, "--web", web])
        self.wait_for("the gateway", lambda: self.listens(self.gateway_port), needs="gateway")

    def bridge_pacs(self):
        """How the bridge asks the PACS: by DICOMweb, or by associations."""
        if self.by_web:
            return ["--pacs-url", self.dicomweb]
        return ["--pacs", f"{HOST}:{self.orthanc_dicom}", "--pacs-ae-title", ORTHANC, "--pacs-tls"]

    def bridge_options(self):
        certificate, key = self.identities["bridge"]
        return ["--state-dir", self.folder / "bridge", "--ae-title", BRIDGE, "--listen", f"{HOST}:{self.bridge_dicom}", "--allow-ae", ORTHANC,
                "--allow-from", HOST, "--dicom-cert", certificate, "--dicom-key", key, "--dicom-ca", self.authority.certificate,
                *self.bridge_pacs(), "--recipe", self.recipe, "--quiet-seconds", self.quiet_s, "--plan-threads", self.plan_threads,
                "--accept-defects", "--server", f"localhost:{self.server_port}", "--server-ca", self.authority.certificate, "--server-cert", certificate,
                "--server-key", key, "--review-listen", f"{HOST}:{self.review_port}", "--planner-url", f"http://localhost:{self.gateway_port}/"]

    def start_bridge(self, more=(), wait=True):
        self.start("bridge", [self.bridge_program, "run", *self.bridge_options(), *more])
        if not wait:
            return
        self.wait_for("the bridge", lambda: self.listens(self.bridge_dicom), needs="bridge")

    def bridge_status(self):
        run = subprocess.run(list(map(str, [self.programs / "tissueform-pacs", "status", "--json", "--state-dir", self.folder / "bridge"])),
                             capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        return json.loads(run.stdout) if run.returncode == 0 else {}

    def review(self):
        with urllib.request.urlopen(f"http://{HOST}:{self.review_port}/", timeout=PATIENCE_S) as reply:
            return reply.read().decode()

    def forms(self):
        """What the review page asks a person for: the fields of each form."""
        forms = re.findall(r"<form[^>]*action=\"/store\">(.*?)</form>", self.review(), re.DOTALL)
        return [dict(re.findall(r"name=\"(\w+)\" value=\"([^\"]*)\"", form)) for form in forms]

    def confirm(self, fields):
        """The person's word."""
        data = urllib.parse.urlencode(fields).encode()
        request = urllib.request.Request(f"http://{HOST}:{self.review_port}/store", data=data,
                                         headers={"Origin": f"http://{HOST}:{self.review_port}"})
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as reply:
            return reply.status

    def cases(self):
        """Names of the cases that the server has."""
        return re.findall(r"cases/[0-9a-f]{64}", self.tissueform("case", "list").stdout)

    def predict(self, case, title="Jaw forward", model=None):
        """A prediction of the case at the plan's own poses, by the plan's model or another, as the planner makes one; its name."""
        plan = next((self.folder / "bridge").rglob("plan.json"))
        chosen = [] if model is None else ["--model", model]
        made = self.tissueform("prediction", "create", plan, "--case", case, "--title", title, *chosen)
        found = re.search(r"^predictions/\S+", made.stdout, re.MULTILINE)
        if found is None:
            raise SystemExit(f"no prediction: {made.stdout}{made.stderr}")
        return found.group(0)
