#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Checks every #include of the tree against tests/scripts/layers.toml.

    tests/scripts/check_layers.py [--root DIR] [--table FILE]

Errors: an edge between wings or folders that the table does not allow; a library outside its fence or unknown; an
include that is relative, not written from the repository root, in angle brackets although it is ours, of
a .cc file or of a file that does not exist; a folder that the table does not name; a folder of the table that
does not exist; a circle among folders, files or Python scripts (imports inside functions count, too). Exit code 0 when there is no such edge, 1 otherwise, 2 for wrong use.
"""

import argparse
import ast
import fnmatch
import graphlib
import pathlib
import re
import sys
import tomllib

OUR_FOLDERS = ("core", "proto", "server", "client", "tests")
SOURCE_SUFFIXES = (".h", ".cc")
SCRIPT_FOLDERS = (".ci", "cmake", "client", "core", "deploy", "server", "tests")
INCLUDE = re.compile(r'^\s*#\s*include\s*(["<])([^">]+)[">]')
# C headers that come with the C++ standard library; everything else of it has neither slash nor dot.
C_STANDARD_HEADERS = {"stdint.h", "stddef.h", "string.h", "stdlib.h", "stdio.h", "math.h", "errno.h"}


class Table:
    """The allowed edges, as layers.toml states them."""

    def __init__(self, text):
        data = tomllib.loads(text)
        unknown = set(data) - {"wings", "folders", "library"}
        if unknown:
            raise ValueError(f"unknown key {sorted(unknown)[0]!r}")
        self.wings = data.get("wings", {})
        self.folders = data.get("folders", {})
        self.libraries = data.get("library", [])

    def name_of(self, folder):
        """The entry for a folder: its own name before the longest pattern; None when there is neither."""
        if folder in self.folders:
            return folder
        patterns = [p for p in self.folders if p.endswith("/*") and fnmatch.fnmatchcase(folder, p)]
        return max(patterns, key=len, default=None)

    def wing_allows(self, source, target):
        """Whether the wing of `source` may use `target`; folders of no wing (tests) may use all."""
        wing = source.split("/")[0]
        allowed = [wing, *self.wings[wing]] if wing in self.wings else [target]
        return any(target == folder or target.startswith(f"{folder}/") for folder in allowed)

    def allows(self, source, target):
        if source == target:
            return True
        return any(fnmatch.fnmatchcase(target, p) for p in self.folders[self.name_of(source)])

    def library_error(self, file, header):
        known = [x for x in self.libraries if any(fnmatch.fnmatchcase(header, p) for p in x["headers"])]
        if not known:
            return f"<{header}> is of no library that the table knows"
        for library in known:
            inside = any(fnmatch.fnmatchcase(file, p) for p in library["files"])
            if inside and not any(fnmatch.fnmatchcase(file, p) for p in library.get("except", [])):
                return None
        name = known[0].get("name", known[0]["headers"][0])
        return f"<{header}> ({name}) belongs to {', '.join(known[0]['files'])} only"


def includes_of(path):
    """(line number, opening bracket, name) of every include."""
    lines = path.read_text(encoding="utf-8").splitlines()
    matches = ((number, INCLUDE.match(line)) for number, line in enumerate(lines, start=1))
    return [(number, m.group(1), m.group(2)) for number, m in matches if m]


def exists(root, name):
    """Whether a name from the root is a file, or one that CMake or protoc makes of a file in the tree."""
    source = re.sub(r"(\.grpc)?\.pb\.h$", ".proto", name)
    return any((root / candidate).is_file() for candidate in (name, f"{name}.in", source))


def check_include(root, table, file, bracket, name):
    """An error for one include, or None."""
    if re.match(r"tissueform/.*\.pb\.h$", name):  # protoc names its files from the folder proto
        name = f"proto/{name}"
    top = name.split("/")[0]
    ours = "/" in name and top in OUR_FOLDERS
    if name.startswith(".") or "/../" in name or "/./" in name:
        return f'"{name}" is relative; write it from the repository root'
    if not ours:
        if bracket == '"' and (root / file).parent.joinpath(name).is_file():
            return f'"{name}" is relative; write it from the repository root'
        if name in C_STANDARD_HEADERS or ("/" not in name and "." not in name):
            return None
        return table.library_error(file, name)
    if bracket == "<":
        return f"<{name}> is ours; write it in quotes"
    if not name.endswith(".h"):
        return f'"{name}" is not a header'
    if not exists(root, name):
        return f'"{name}" does not exist'
    source, target = str(pathlib.PurePosixPath(file).parent), str(pathlib.PurePosixPath(name).parent)
    if table.name_of(source) is None:
        return None  # reported once for the folder
    if not table.wing_allows(source, target):
        return f"{source.split('/')[0]} may not include {target} ({name}): see [wings]"
    if not table.allows(source, target):
        return f"{source} may not include {target} ({name})"
    return None


def cycle_error(graph, what):
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as error:
        return [f"circle among {what}: {' -> '.join(reversed(error.args[1]))}"]
    return []


def modules_imported_by(path):
    """Names of all modules that a script imports, wherever in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module


def script_graph(root):
    """Which of our scripts imports which. A name means the script in the same folder, otherwise every script of that name."""
    scripts = [p for top in SCRIPT_FOLDERS for p in (root / top).rglob("*.py") if "node_modules" not in p.parts]
    graph = {}
    for path in scripts:
        for module in set(modules_imported_by(path)):
            named = [p for p in scripts if p.stem == module]
            beside = [p for p in named if p.parent == path.parent]
            graph.setdefault(path.relative_to(root).as_posix(), set()).update(p.relative_to(root).as_posix() for p in beside or named)
    return graph


def check(root, table):
    """All errors of the tree, in order."""
    errors, file_graph, folder_graph, folders = [], {}, {}, set()
    paths = sorted(p for top in OUR_FOLDERS for p in (root / top).rglob("*") if p.suffix in SOURCE_SUFFIXES)
    for path in paths:
        file = path.relative_to(root).as_posix()
        folder = str(pathlib.PurePosixPath(file).parent)
        folders.add(folder)
        for number, bracket, name in includes_of(path):
            error = check_include(root, table, file, bracket, name)
            if error:
                errors.append(f"{file}:{number}: {error}")
            elif (root / name).is_file():
                file_graph.setdefault(file, set()).add(name)
                target = str(pathlib.PurePosixPath(name).parent)
                if target != folder:
                    folder_graph.setdefault(folder, set()).add(target)
    errors += [f"{f}: the table does not name this folder" for f in sorted(folders) if table.name_of(f) is None]
    errors += [f"{f}: the table names a folder that has no source file"
               for f in table.folders if not f.endswith("/*") and f not in folders]
    return errors + cycle_error(file_graph, "files") + cycle_error(folder_graph, "folders") + cycle_error(script_graph(root), "scripts")


def main():
    here = pathlib.Path(__file__).resolve().parent
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", type=pathlib.Path, default=here.parent.parent)
    parser.add_argument("--table", type=pathlib.Path, default=here / "layers.toml")
    arguments = parser.parse_args()
    try:
        table = Table(arguments.table.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        print(f"check_layers.py: {arguments.table}: {error}", file=sys.stderr)
        return 2
    errors = check(arguments.root, table)
    for error in errors:
        print(error, file=sys.stderr)
    if errors:
        print(f"check_layers.py: {len(errors)} wrong includes; the table is {arguments.table}", file=sys.stderr)
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
