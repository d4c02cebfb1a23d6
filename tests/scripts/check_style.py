#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Checks what no other tool does: the form of files.

    tests/scripts/check_style.py

Every source file begins with the two lines of copyright and licence (after a #! line, which only executable files have); headers have `#pragma once`;
no file holds a mark of unfinished work, a tab, a blank at the end of a line or more than 600 lines; processes are made
in core/base/process only (tests may make their own). No two headers define a type of the same name in one namespace:
a program that links both would break the one-definition rule.
"""

import pathlib
import re
import stat
import sys

FOLDERS = (".ci", "cmake", "client", "core", "deploy", "proto", "server", "tests")
SUFFIXES = {".h", ".cc", ".py", ".sh", ".cmake", ".proto", ".toml", ".ts", ".mjs"}
# What npm and protoc put there.
FOREIGN = ("node_modules", "generated")
MAX_LINES = 600
COPYRIGHT = re.compile(r"(//|#) Copyright 20\d\d The Tissueform Authors\.")
LICENCE = re.compile(r"(//|#) SPDX-License-Identifier: AGPL-3\.0-or-later")
MAKES_PROCESS = re.compile(r"(?<![\w.>])(v?fork|popen|posix_spawnp?|setitimer)\(|(?<![\w.>])system\([^)]")
NAMESPACE = re.compile(r"namespace ([\w:]+) \{")
# A definition at the start of a line, as clang-format lays it out; a mere declaration ends with the name.
TYPE = re.compile(r"(?:class|struct|union|enum(?: class)?) (?:[A-Z][A-Z_]+(?:\([^)]*\))? )?(\w+)\b(?![^{]*;$)|using (\w+) =")
UNFINISHED = re.compile(r"\b(TO" r"DO|FIX" r"ME|X" r"XX)\b")


def errors_of(name, text):
    """(line, message) for every fault of one file."""
    lines = text.splitlines()
    start = 1 if lines and lines[0].startswith("#!") else 0
    head = lines[start:start + 2]
    if len(head) < 2 or not COPYRIGHT.fullmatch(head[0]) or not LICENCE.fullmatch(head[1]):
        yield start + 1, "begin with the two lines of copyright and licence"
    if name.endswith(".h") and "#pragma once" not in lines:
        yield 1, "a header needs #pragma once"
    if len(lines) > MAX_LINES:
        yield len(lines), f"longer than {MAX_LINES} lines: cut it by topic"
    makes_processes = name.startswith(("core/base/process/", "tests/")) or not name.endswith((".cc", ".h"))
    for number, line in enumerate(lines, start=1):
        if not makes_processes and MAKES_PROCESS.search(line.split("//")[0]):
            yield number, "processes are made in core/base/process only: ChildProcess, CallHelper, GuardedProgram"
        if UNFINISHED.search(line):
            yield number, "unfinished work belongs in an issue"
        if "\t" in line or line != line.rstrip():
            yield number, "a tab, or a blank at the end"


def errors_of_mode(name, text, mode):
    """(line, message) where a file that begins with #! may not be executed."""
    if text.startswith("#!") and not mode & stat.S_IXUSR:
        yield 1, f"begins with #!, but cannot be executed: chmod +x {name}"


def types_of(text):
    """(line, name with its namespace) of the types that a header defines."""
    namespace = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if opened := NAMESPACE.match(line):
            namespace = opened[1]
        elif found := TYPE.match(line):
            yield number, f"{namespace}::{found[1] or found[2]}"


def types_defined_twice(headers):
    """(header, line, message) for each type whose name an earlier header has defined; `headers`: (name, text)."""
    first = {}
    for name, text in headers:
        for number, type_name in types_of(text):
            other = first.setdefault(type_name, name)
            if other != name:
                yield name, number, f"{other} defines a type {type_name}, too: rename one of them"


def main():
    root = pathlib.Path(__file__).resolve().parent.parent.parent
    paths = sorted(p for folder in FOLDERS for p in (root / folder).rglob("*") if p.is_file())
    count = 0
    headers = []
    for path in paths:
        name = path.relative_to(root).as_posix()
        if name.startswith("tests/data/") or any(part in FOREIGN for part in path.parts) or (path.suffix not in SUFFIXES and name != ".ci/run"):
            continue
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".h":
            headers.append((name, text))
        for number, message in [*errors_of(name, text), *errors_of_mode(name, text, path.stat().st_mode)]:
            print(f"{name}:{number}: {message}", file=sys.stderr)
            count += 1
    for name, number, message in types_defined_twice(headers):
        print(f"{name}:{number}: {message}", file=sys.stderr)
        count += 1
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
