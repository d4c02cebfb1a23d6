#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Writes the software bill of materials of one package: SPDX 2.3 as JSON.

  deploy/write_sbom.py PACKAGE FOLDER FILE

FOLDER is what the package installs (deploy/build_packages.sh). The file lists

  * the Debian packages of all shared libraries that the programs in FOLDER load: DYNAMIC_LINK where a program names the
    library itself, DEPENDS_ON where another library does;
  * the npm packages in the planner, and what its WebAssembly links, where FOLDER has the planner;
  * the Debian packages with the purpose `build` of deploy/packages.txt: BUILD_DEPENDENCY_OF. Headers of some (Eigen, Boost,
    CGAL, CLI11, nlohmann-json) are compiled into the programs.

Versions are those of this machine. A license is what the package itself states (deploy/debian_licenses.py, package-lock.json);
NOASSERTION: the copyright file is free text. SOURCE_DATE_EPOCH sets the date, so that equal inputs give equal bytes.
"""

import base64
import datetime
import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys
import urllib.parse

import debian_licenses

ROOT = pathlib.Path(__file__).resolve().parents[1]
OWN = "SPDXRef-tissueform"
DOCUMENT = "SPDXRef-DOCUMENT"
# Linked into the planner's WebAssembly by deploy/build_web.sh.
WASM_LIBRARIES = ("libc++-14-dev-wasm32", "libclang-rt-14-dev-wasm32", "wasi-libc")


def output_of(*words):
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, check=True).stdout


def programs_in(folder):
    """Programs and modules: what begins as an ELF file does."""
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            with path.open("rb") as file:
                if file.read(4) == b"\x7fELF":
                    yield path


def libraries_of(program):
    """(path, whether the program itself names it) of each shared library that the program loads."""
    named = set(re.findall(r"\(NEEDED\).*\[(.*)\]", output_of("readelf", "--dynamic", program)))
    loaded = output_of("ldd", program)
    missing = re.search(r"(\S+) => not found", loaded)
    if missing:
        raise RuntimeError(f"{program.name} needs {missing[1]}, which is not installed; run deploy/install_packages.sh")
    for name, path in re.findall(r"(\S+) => (/\S+)", loaded):
        yield pathlib.Path(path).resolve(), name in named


def owners_of(libraries):
    """Library: the Debian package that installed it. Its record may name /lib, which is /usr/lib here."""
    names = {name: path for path in libraries for name in (str(path), str(path).removeprefix("/usr"))}
    # The exit code shows only that one of the two names is unknown, which is always so.
    found = subprocess.run(["dpkg-query", "--search", *names], capture_output=True, text=True).stdout
    owners = {names[line.split(": ")[-1]]: line.split(":")[0] for line in found.splitlines() if line.split(": ")[-1] in names}
    for path in libraries:
        if path not in owners:
            raise RuntimeError(f"{path} belongs to no Debian package; build with the packages of deploy/packages.txt only")
    return owners


def linked_packages(folder):
    """Debian package: whether a program names one of its libraries."""
    libraries = {}
    for program in programs_in(folder):
        for path, is_named in libraries_of(program):
            libraries[path] = libraries.get(path, False) or is_named
    packages = {}
    for path, owner in owners_of(libraries).items():
        packages[owner] = packages.get(owner, False) or libraries[path]
    return packages


def build_packages(listed):
    """Names with the purpose `build`, without tools and what only runs: none of their code is in the programs."""
    for line in listed.splitlines():
        words = line.split()
        if len(words) > 1 and not line.startswith("#") and words[1] == "build" and re.search(r"-dev$|^grpc-proto$", words[0]):
            yield words[0]


def debian_packages(names):
    """name: SPDX package, of installed Debian packages."""
    form = "${Package}\t${Version}\t${Architecture}\t${source:Package}\t${source:Version}\n"
    shown = output_of("dpkg-query", "--show", "--showformat", form, *names).splitlines()
    return {line.split("\t")[0]: debian_package(*line.split("\t")) for line in shown}


def debian_package(name, version, architecture, source, source_version):
    notice = pathlib.Path("/usr/share/doc") / name / "copyright"
    stated = debian_licenses.stated_license(notice.read_text(encoding="utf-8", errors="replace")) if notice.exists() else None
    quoted = urllib.parse.quote(version, safe="~")
    entry = package("deb", name, version, f"pkg:deb/debian/{urllib.parse.quote(name)}@{quoted}?arch={architecture}&distro=debian-12")
    return entry | {"supplier": "Organization: Debian", "sourceInfo": f"Debian source package {source} {source_version}",
                    "licenseDeclared": debian_licenses.spdx_expression(stated),
                    "licenseComments": f"{notice} states: {stated or 'free text'}"}


def npm_packages(lock):
    """SPDX packages of what the planner holds: package-lock.json without what is for development."""
    for path, entry in sorted(lock["packages"].items()):
        if path and not entry.get("dev"):
            name, version = path.split("node_modules/")[-1], entry["version"]
            found = package("npm", name, version, f"pkg:npm/{name.replace('@', '%40')}@{version}")
            found["licenseDeclared"] = entry.get("license", "NOASSERTION")
            algorithm, _, value = entry.get("integrity", "").partition("-")
            if value:
                found["checksums"] = [{"algorithm": algorithm.upper(), "checksumValue": base64.b64decode(value).hex()}]
            yield found


def package(kind, name, version, url):
    return {"SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", f"{kind}-{name}-{version}"), "name": name, "versionInfo": version,
            "downloadLocation": "NOASSERTION", "filesAnalyzed": False, "licenseConcluded": "NOASSERTION",
            "licenseDeclared": "NOASSERTION", "copyrightText": "NOASSERTION",
            "externalRefs": [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": url}]}


def license_references(packages):
    """What SPDX does not list is named by where its text is."""
    for name in sorted({term for each in packages for term in re.findall(r"LicenseRef-[A-Za-z0-9.-]+", each["licenseDeclared"])}):
        holders = [each["name"] for each in packages if name in each["licenseDeclared"].split()]
        yield {"licenseId": name, "extractedText": f"The text is in /usr/share/doc/{holders[0]}/copyright of Debian 12."}


def related(kind, entry, is_reversed=False):
    """One package and how the own one is related to it."""
    pair = (entry["SPDXID"], OWN) if is_reversed else (OWN, entry["SPDXID"])
    return entry, {"spdxElementId": pair[0], "relationshipType": kind, "relatedSpdxElement": pair[1]}


def materials(folder, listed, lock):
    """(SPDX package, relation) of everything that is in a package or compiled into it."""
    linked = linked_packages(folder)
    compiled_in = [name for name in build_packages(listed) if name not in linked]
    has_planner = (folder / "usr/share/tissueform/web/index.html").exists()
    in_planner = WASM_LIBRARIES if has_planner else ()
    described = debian_packages([*linked, *compiled_in, *in_planner])
    for name, is_named in sorted(linked.items()):
        yield related("DYNAMIC_LINK" if is_named else "DEPENDS_ON", described[name])
    for entry in npm_packages(lock) if has_planner else ():
        yield related("CONTAINS", entry)
    for name in in_planner:
        yield related("STATIC_LINK", described[name])
    for name in compiled_in:
        yield related("BUILD_DEPENDENCY_OF", described[name], is_reversed=True)


def document(name, version, created, found):
    """The SPDX document of the package `name`; `found` as of materials()."""
    own = {"SPDXID": OWN, "name": name, "versionInfo": version, "downloadLocation": "NOASSERTION", "filesAnalyzed": False,
           "licenseConcluded": "AGPL-3.0-or-later", "licenseDeclared": "AGPL-3.0-or-later",
           "copyrightText": "Copyright 2026 The Tissueform Authors", "comment": "Research software, not a medical device."}
    packages = [entry for entry, _ in found]
    identity = hashlib.sha256(json.dumps(found, sort_keys=True).encode()).hexdigest()[:16]
    described = {"spdxElementId": DOCUMENT, "relationshipType": "DESCRIBES", "relatedSpdxElement": OWN}
    return {"spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": DOCUMENT, "name": f"{name}-{version}",
            "documentNamespace": f"https://spdx.org/spdxdocs/{name}-{version}-{identity}",
            "creationInfo": {"created": created, "creators": ["Organization: The Tissueform Authors", f"Tool: write_sbom.py-{version}"]},
            "packages": [own, *packages], "relationships": [described, *(relation for _, relation in found)],
            "hasExtractedLicensingInfos": list(license_references(packages))}


def main(name, folder, target):
    version = re.search(r"^project\(tissueform VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.MULTILINE)[1]
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", datetime.datetime.now().timestamp()))
    created = datetime.datetime.fromtimestamp(seconds, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    listed = (ROOT / "deploy/packages.txt").read_text(encoding="utf-8")
    lock = json.loads((ROOT / "client/web/package-lock.json").read_text(encoding="utf-8"))
    found = list(materials(folder, listed, lock))
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(json.dumps(document(name, version, created, found), indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 4:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    try:
        sys.exit(main(sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])))
    except (OSError, RuntimeError) as error:
        print(f"write_sbom.py: {error}", file=sys.stderr)
        sys.exit(1)
    except subprocess.CalledProcessError as error:
        print(f"write_sbom.py: {' '.join(error.cmd)}: exit code {error.returncode}: {error.stderr.strip()}", file=sys.stderr)
        sys.exit(1)
