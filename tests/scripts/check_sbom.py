#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Judges bills of materials: SPDX 2.3 as JSON.

    tests/scripts/check_sbom.py FILE...

The form by a JSON schema (python3-jsonschema) of the fields that we and `npm sbom` write, after the SPDX 2.3 specification;
license expressions by python3-license-expression and the SPDX list in it; references between elements; package URLs. Neither
Debian 12 nor npm has a validator of whole SPDX 2.3 documents. Prints one line for each fault; exit code 1 when there is one.
"""

import functools
import json
import pathlib
import re
import sys

import jsonschema
import license_expression

TEXT = {"type": "string", "minLength": 1}
ELEMENT = {"type": "string", "pattern": "^SPDXRef-[A-Za-z0-9.-]+$"}
TIME = {"type": "string", "pattern": r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z$"}
URI = {"type": "string", "pattern": r"^[a-z]+://[^\s#]+$"}
# Relationships that we and npm write; the specification has more.
RELATIONSHIPS = ["DESCRIBES", "CONTAINS", "DEPENDS_ON", "DEPENDENCY_OF", "DYNAMIC_LINK", "STATIC_LINK", "BUILD_DEPENDENCY_OF",
                 "DEV_DEPENDENCY_OF", "OPTIONAL_DEPENDENCY_OF", "HAS_PREREQUISITE", "PREREQUISITE_FOR"]


def record(required, optional):
    return {"type": "object", "properties": required | optional, "required": sorted(required), "additionalProperties": False}


def several(item):
    return {"type": "array", "items": item}


CHECKSUM = record({"algorithm": {"enum": ["SHA1", "SHA256", "SHA384", "SHA512"]},
                   "checksumValue": {"type": "string", "pattern": "^([0-9a-f]{40}|[0-9a-f]{64}|[0-9a-f]{96}|[0-9a-f]{128})$"}}, {})
PURL = record({"referenceCategory": {"const": "PACKAGE-MANAGER"}, "referenceType": {"const": "purl"},
               "referenceLocator": {"type": "string", "pattern": r"^pkg:(deb/debian|npm)/[A-Za-z0-9._%/+-]+@[A-Za-z0-9._%~-]+(\?[a-z]+=[^&]+(&[a-z]+=[^&]+)*)?$"}}, {})
PACKAGE = record({"SPDXID": ELEMENT, "name": TEXT, "downloadLocation": TEXT},
                 {"versionInfo": TEXT, "supplier": {"type": "string", "pattern": "^(Organization|Person): .|^NOASSERTION$"},
                  "filesAnalyzed": {"type": "boolean"}, "licenseConcluded": TEXT, "licenseDeclared": TEXT, "licenseComments": TEXT,
                  "copyrightText": TEXT, "sourceInfo": TEXT, "comment": TEXT, "description": TEXT, "homepage": TEXT,
                  "packageFileName": {"type": "string"}, "primaryPackagePurpose": {"enum": ["APPLICATION", "LIBRARY"]},
                  "externalRefs": several(PURL), "checksums": several(CHECKSUM)})
RELATION = record({"spdxElementId": ELEMENT, "relatedSpdxElement": ELEMENT, "relationshipType": {"enum": RELATIONSHIPS}}, {})
SCHEMA = record(
    {"spdxVersion": {"const": "SPDX-2.3"}, "dataLicense": {"const": "CC0-1.0"}, "SPDXID": {"const": "SPDXRef-DOCUMENT"}, "name": TEXT,
     "documentNamespace": URI, "packages": several(PACKAGE), "relationships": several(RELATION),
     "creationInfo": record({"created": TIME, "creators": several({"type": "string", "pattern": "^(Tool|Organization|Person): ."})}, {})},
    {"documentDescribes": several(ELEMENT),
     "hasExtractedLicensingInfos": several(record({"licenseId": {"type": "string", "pattern": "^LicenseRef-[A-Za-z0-9.-]+$"},
                                                   "extractedText": TEXT}, {}))})
LICENSES = license_expression.get_spdx_licensing()


@functools.cache
def unknown_licenses(expression):
    """Names in a license expression that are not on the SPDX list; a LicenseRef is one. NOASSERTION and NONE are no expressions."""
    if expression in ("NOASSERTION", "NONE"):
        return frozenset()
    judged = LICENSES.validate(expression)
    return frozenset(judged.invalid_symbols or judged.errors)


def form_faults(document):
    for error in jsonschema.Draft201909Validator(SCHEMA).iter_errors(document):
        yield f"{'/'.join(str(each) for each in error.absolute_path) or 'document'}: {error.message[:200]}"


def license_faults(document):
    own = {each["licenseId"] for each in document.get("hasExtractedLicensingInfos", [])}
    used = set()
    for entry in document["packages"]:
        for field in ("licenseDeclared", "licenseConcluded"):
            expression = entry.get(field, "NOASSERTION")
            references = set(re.findall(r"LicenseRef-[A-Za-z0-9.-]+", expression))
            used |= references
            unknown = unknown_licenses(expression) - own
            if unknown:
                yield f"{entry['SPDXID']}: {field} {expression}: unknown {', '.join(sorted(unknown))}"
    for name in sorted(own - used):
        yield f"{name} is described and not used"


def reference_faults(document):
    names = [document["SPDXID"], *(each["SPDXID"] for each in document["packages"])]
    for name in sorted({name for name in names if names.count(name) > 1}):
        yield f"{name} is there {names.count(name)} times"
    mentioned = set()
    for relation in document["relationships"]:
        for field in ("spdxElementId", "relatedSpdxElement"):
            mentioned.add(relation[field])
            if relation[field] not in names:
                yield f"a relation names {relation[field]}, which is not in the document"
    for name in sorted(set(names) - mentioned):
        yield f"{name} is in no relation"


def faults(document):
    """One line for each fault; the later checks need a document of the right form."""
    found = list(form_faults(document))
    return found or [*license_faults(document), *reference_faults(document)]


def main(files):
    wrong = [f"{file}: {fault}" for file in files for fault in faults(json.loads(pathlib.Path(file).read_text(encoding="utf-8")))]
    print("\n".join(wrong) if wrong else f"{len(files)} bills of materials are whole")
    return 1 if wrong else 0


if __name__ == "__main__":
    if len(sys.argv) < 2:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    sys.exit(main(sys.argv[1:]))
