#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Whether a JSON file follows a schema of docs, and whether the schema refuses the file once it is damaged anywhere.

  check_schema.py SCHEMA FILE [--optional OBJECT]...

Each key is left out once, each object gets an unknown key once, each value another type once, in the first and the last
item of each list. --optional names the
objects (by their last key; "" is the whole file) whose keys may be missing. Prints a line for each finding. By
python3-jsonschema, not by the validator of our programs.
"""

import argparse
import copy
import json
import sys

import jsonschema


def shortened(value):
    """Without the middle of lists, whose items are alike: otherwise there are thousands of places to damage."""
    if isinstance(value, dict):
        return {key: shortened(child) for key, child in value.items()}
    if isinstance(value, list):
        return [shortened(child) for child in (value if len(value) < 3 else [value[0], value[-1]])]
    return value


def places(value, path=()):
    """Paths of a document's values, the document's own first."""
    yield path, value
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in children:
        yield from places(child, path + (key,))


def at(document, path):
    for key in path:
        document = document[key]
    return document


def of_another_type(value):
    return 1 if isinstance(value, (str, list, dict)) else "text"


def changed(document, path, value):
    if not path:
        return value
    copied = copy.deepcopy(document)
    at(copied, path[:-1])[path[-1]] = value
    return copied


def without(document, path):
    copied = copy.deepcopy(document)
    del at(copied, path[:-1])[path[-1]]
    return copied


def damaged(document, optional):
    """(what was done, the document with that damage)."""
    for path, value in places(document):
        name = "/" + "/".join(map(str, path))
        yield f"{name} has another type", changed(document, path, of_another_type(value))
        if isinstance(value, dict):
            yield f"{name} has an unknown key", changed(document, path, {**value, "unknown key": {}})
            for key in value:
                if (path[-1] if path else "") not in optional:
                    yield f"{name} has no {key}", without(document, path + (key,))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("schema")
    parser.add_argument("file")
    parser.add_argument("--optional", action="append", default=[])
    options = parser.parse_args()
    with open(options.schema, encoding="utf-8") as text:
        schema = json.load(text)
    with open(options.file, encoding="utf-8") as text:
        document = json.load(text)
    jsonschema.Draft7Validator.check_schema(schema)
    validator = jsonschema.Draft7Validator(schema)
    findings = [f"/{'/'.join(map(str, error.path))}: {error.message[:200]}" for error in validator.iter_errors(document)]
    if not findings:
        damages = damaged(shortened(document), options.optional)
        findings = [f"follows the schema though {what}" for what, wrong in damages if validator.is_valid(wrong)]
    print("\n".join(findings[:20]))
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
