#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Puts source files together for clang-tidy, which spends nearly all of its time on the headers that they share.

  tests/scripts/tidy_batches.py BUILD_DIR [FILE.cc]...

Writes into BUILD_DIR/tidy files batch_N.cc that include some source files each, and a compile_commands.json with those
and with all source files by themselves. Prints a line for each batch: its file, a tab, the source files.

Files come together when their commands give no macro two values and when, as far as the first words of their lines
show, they name nothing the same, and nothing that a header of the other names: names of unnamed namespaces must meet
neither each other nor a header's. A batch that still does not compile is the caller's to take apart.
"""

import functools
import json
import pathlib
import re
import shlex
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "cmake"))
from source_names import LONERS, declared_names, imported_names  # noqa: E402

MOST_FILES = 24

# The one name that all programs share: in a batch each is another function.
MAIN = re.compile(r"^int main\(", re.MULTILINE)

INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)

KNOWS_GCC_ONLY = re.compile(r"^#include <itk", re.MULTILINE)


def compile_command(entry):
    """The arguments without input and output files, and without GCC's precompiled header."""
    arguments = shlex.split(entry["command"])
    kept = []
    skip = 0
    for position, argument in enumerate(arguments):
        if skip:
            skip -= 1
        elif argument in ("-o", "-c"):
            skip = 1
        elif argument == "-include" and arguments[position + 1].endswith("cmake_pch.hxx"):
            skip = 1
        elif argument != "-Winvalid-pch":
            kept.append(argument)
    return kept


def sources_of(entry):
    """The file, or those that a unity build has put together in it."""
    path = pathlib.Path(entry["file"]).resolve()
    if not path.name.startswith("unity_"):
        return [path]
    included = re.findall(r'^#include "(.+)"', path.read_text(encoding="utf-8"), re.MULTILINE)
    return [pathlib.Path(name).resolve() for name in included]


def macros(command):
    return dict(argument[2:].partition("=")[::2] for argument in command if argument.startswith("-D"))


names_in = functools.cache(declared_names)


def names_in_headers(path):
    """What the project's headers declare that this file includes, directly or not."""
    reached = set()
    waiting = [path]
    while waiting:
        includes = INCLUDE.findall(waiting.pop().read_text(encoding="utf-8"))
        # CMake makes some headers of NAME.h.in.
        candidates = {ROOT / (name + ending) for name in includes for ending in ("", ".in")}
        new = {header for header in candidates - reached if header.is_file()}
        reached |= new
        waiting += new
    return {name for header in reached for name in names_in(header)}


class Batch:
    def __init__(self, alone=False):
        self.alone = alone
        self.files = []
        self.names = set()
        self.own_names = set()  # that no header of their file declares
        self.header_names = set()
        self.imports = set()
        self.macros = {}
        self.command = []

    def takes(self, names, headers, imports, command):
        if self.alone:
            return False
        agree = all(self.macros.get(name, value) == value for name, value in macros(command).items())
        clash = names & (self.names | self.imports) or imports & self.names
        clash |= (names - headers) & self.header_names or headers & self.own_names
        return agree and len(self.files) < MOST_FILES and not clash

    def add(self, path, names, headers, imports, command):
        self.files.append(path)
        self.header_names |= headers
        self.names |= names
        self.own_names |= names - headers
        self.imports |= imports
        self.macros |= macros(command)
        # "-isystem FOLDER" is two words that stay together.
        words = re.findall(r"-isystem\0[^\0]+|[^\0]+", "\0".join(command))
        self.command += [word for word in words if word not in self.command]

    def arguments(self):
        return [argument for word in self.command for argument in word.split("\0")]


def put_together(files):
    """Batches; `files` are (path, command) pairs."""
    batches = []
    for path, command in files:
        headers = names_in_headers(path)
        names = declared_names(path) - {"main"}
        imports = imported_names(path)
        if LONERS.search(path.read_text(encoding="utf-8")):
            batch = Batch(alone=True)
        else:
            batch = next((batch for batch in batches if batch.takes(names, headers, imports, command)), Batch())
        if batch not in batches:
            batches.append(batch)
        batch.add(path, names, headers, imports, command)
    return batches


def included(number, path):
    """The line of a batch that includes its file with this number."""
    line = f'#include "{path}"\n'
    if MAIN.search(path.read_text(encoding="utf-8")):
        return f"#define main Main{number}\n{line}#undef main\n"
    return line


def main():
    build = pathlib.Path(sys.argv[1]).resolve()
    chosen = {pathlib.Path(name).resolve() for name in sys.argv[2:]}
    entries = json.loads((build / "compile_commands.json").read_text(encoding="utf-8"))
    commands = {path: compile_command(entry) for entry in entries for path in sources_of(entry)}
    for path in [path for path in commands if path in chosen and KNOWS_GCC_ONLY.search(path.read_text(encoding="utf-8"))]:
        print(f"tidy_batches.py: {path.name} is left out: Debian's ITK refuses every compiler but GCC", file=sys.stderr)
        chosen.discard(path)
        del commands[path]
    folder = build / "tidy"
    folder.mkdir(exist_ok=True)
    database = []

    def add(path, command):
        database.append({"directory": str(build), "file": str(path), "arguments": [*command, "-c", str(path)]})

    for path, command in commands.items():
        add(path, command)
    for path in chosen - commands.keys():  # the fuzzers' main program, which only clang builds: as its neighbours
        commands[path] = next(command for other, command in commands.items() if other.parent == path.parent)
        add(path, commands[path])
    # In the order of their folders: neighbours include the same.
    files = sorted((path, commands[path]) for path in chosen)
    lines = []
    for number, batch in enumerate(put_together(files)):
        path = folder / f"batch_{number}.cc"
        path.write_text("".join(included(*numbered) for numbered in enumerate(batch.files)), encoding="utf-8")
        add(path, batch.arguments())
        lines.append(f"{path}\t{' '.join(str(file) for file in batch.files)}")
    (folder / "compile_commands.json").write_text(json.dumps(database), encoding="utf-8")
    # Not before: the program that reads the lines begins at once.
    print(*lines, sep="\n")


if __name__ == "__main__":
    main()
