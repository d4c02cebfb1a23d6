#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Writes the software bill of materials: SPDX 2.3 as JSON, of what the programs and the page are made of.

  deploy/write_sbom.py [FILE]     (default: build/tissueform.spdx.json)

Debian's packages are those of deploy/packages.txt with the purposes build and run that are installed here, npm's those of
client/web/package-lock.json that are not for development. Licenses of Debian's packages are not asserted: see
docs/dependencies.md and /usr/share/doc/PACKAGE/copyright.
"""

import datetime
import hashlib
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]


def debian_packages(listed, query):
    """(name, version) of the listed packages that are installed; `query(names)` gives dpkg-query's lines NAME VERSION."""
    names = [words[0] for line in listed.splitlines() if (words := line.split()) and not line.startswith("#")
             and words[1] in ("build", "run")]
    return [tuple(line.split()) for line in query(names).splitlines() if len(line.split()) == 2]


def npm_packages(lock):
    """(name, version, license) of the packages that are in the page."""
    for path, entry in sorted(lock["packages"].items()):
        if path and not entry.get("dev"):
            yield path.split("node_modules/")[-1], entry["version"], entry.get("license", "NOASSERTION")


def package(name, version, url, license_name="NOASSERTION"):
    return {"SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", f"{name}-{version}"), "name": name, "versionInfo": version,
            "downloadLocation": "NOASSERTION", "filesAnalyzed": False, "licenseConcluded": "NOASSERTION",
            "licenseDeclared": license_name, "copyrightText": "NOASSERTION",
            "externalRefs": [{"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": url}]}


def document(version, created, packages):
    own = {"SPDXID": "SPDXRef-tissueform", "name": "tissueform", "versionInfo": version, "downloadLocation": "NOASSERTION",
           "filesAnalyzed": False, "licenseConcluded": "AGPL-3.0-or-later", "licenseDeclared": "AGPL-3.0-or-later",
           "copyrightText": "The Tissueform Authors"}
    identity = hashlib.sha256(json.dumps(packages, sort_keys=True).encode()).hexdigest()[:16]
    relations = [{"spdxElementId": "SPDXRef-DOCUMENT", "relationshipType": "DESCRIBES", "relatedSpdxElement": own["SPDXID"]}]
    relations += [{"spdxElementId": own["SPDXID"], "relationshipType": "DEPENDS_ON", "relatedSpdxElement": each["SPDXID"]}
                  for each in packages]
    return {"spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT", "name": f"tissueform-{version}",
            "documentNamespace": f"https://spdx.org/spdxdocs/tissueform-{version}-{identity}",
            "creationInfo": {"created": created, "creators": ["Tool: deploy/write_sbom.py"]},
            "packages": [own, *packages], "relationships": relations}


def installed(names):
    return subprocess.run(["dpkg-query", "-W", "-f", "${Package} ${Version}\n", *names], capture_output=True, text=True).stdout


def main():
    target = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build/tissueform.spdx.json")
    version = re.search(r"^project\(tissueform VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.MULTILINE)[1]
    packages = [package(name, number, f"pkg:deb/debian/{name}@{number}?distro=debian-12")
                for name, number in debian_packages((ROOT / "deploy/packages.txt").read_text(encoding="utf-8"), installed)]
    lock = json.loads((ROOT / "client/web/package-lock.json").read_text(encoding="utf-8"))
    packages += [package(name, number, f"pkg:npm/{name.replace('@', '%40')}@{number}", license_name)
                 for name, number, license_name in npm_packages(lock)]
    created = datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(json.dumps(document(version, created, packages), indent=1) + "\n", encoding="utf-8")
    print(f"{target}: {len(packages)} packages")
    return 0


if __name__ == "__main__":
    sys.exit(main())
