#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Doxygen's input filter: makes documentation comments of ours, and C++ of a .proto file.

    docs/api/filter.py FILE.h|FILE.proto     prints the file as Doxygen is to read it
"""

import pathlib
import re
import sys


def streamed(stream, message):
    return f"stream<{message}>" if stream else message


PROTO = [
    (re.compile(r'^(syntax|import|option) .*$'), ""),
    (re.compile(r"^package ([\w.]+);"), lambda m: "namespace " + m.group(1).replace(".", "::") + " {"),
    (re.compile(r"^(\s*)message (\w+) \{(\})?"), r"\1struct \2 {\3"),
    (re.compile(r"^(\s*)service (\w+) \{"), r"\1class \2 { public:"),
    (re.compile(r"^(\s*)oneof \w+ \{"), r"\1union {"),
    (re.compile(r"^(\s*)rpc (\w+)\((stream )?([\w.]+)\)\s*returns \((stream )?([\w.]+)\);?"),
     lambda m: f"{m.group(1)}{streamed(m.group(5), m.group(6))} {m.group(2)}({streamed(m.group(3), m.group(4))} request);"),
    (re.compile(r"^(\s*)reserved .*;"), ""),
    (re.compile(r"^(\s*)([A-Z][A-Z0-9_]+) = (\d+);"), r"\1\2 = \3,"),
    (re.compile(r"^(\s*)(?:optional )?(repeated )?(?:map<(\w+), ([\w.]+)>|([\w.]+)) (\w+) = \d+[^;]*;"),
     lambda m: f"{m.group(1)}{(m.group(2) or '').strip()} {m.group(5) or 'map'} {m.group(6)};".replace(" " * 2, " ")),
]


def documented(line):
    """`//` before a declaration becomes `///`, after one `///<`."""
    line = re.sub(r"^(\s*)//(?=\s|$)", r"\1///", line)
    return re.sub(r"([;,{})]\s+)// ", r"\1///< ", line)


def main():
    path = pathlib.Path(sys.argv[1])
    is_proto = path.suffix == ".proto"
    lines = path.read_text(encoding="utf-8").splitlines()
    for line in lines[2:]:  # without the license
        if is_proto and not line.lstrip().startswith("//"):
            code, slashes, comment = line.partition("  //")
            for pattern, replacement in PROTO:
                code = pattern.sub(replacement, code)
            line = code + slashes + comment
            if re.fullmatch(r"\}", line):
                line = "};"
        # Symbols that are commands or marks of Doxygen.
        line = re.sub(r"([@\\<>#%])", r"\\\1", line) if line.lstrip().startswith("//") else line
        print(documented(line))
    if is_proto:
        print("}")


if __name__ == "__main__":
    main()
