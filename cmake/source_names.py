#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Which source files may be put together into one translation unit: names of unnamed namespaces must not meet.

  cmake/source_names.py MOST_FILES FILE.cc...

Prints the number of a group for each file, one a line: files of a group name nothing the same, as far as the first words
of their lines tell, and there are MOST_FILES of them at most. -1: the file stays alone.
"""

import pathlib
import re
import sys

# Names that a line at the left margin declares: tests, types, aliases, functions and constants.
DECLARATIONS = [
    # Within a function, too: it would hide another file's.
    re.compile(r"^\s+(?:static )?constexpr [\w:<>]+ (k\w+)"),
    re.compile(r"^(?:TYPED_)?TEST(?:_F|_P)?\((\w+),\s*(\w+)\)"),
    re.compile(r"^INSTANTIATE_\w+\((\w+),\s*(\w+)"),
    re.compile(r"^(?:struct|class|enum class|enum|union)\s+(\w+)"),
    re.compile(r"^using\s+(\w+)\s*="),
    re.compile(r"^#define\s+(\w+)"),
    # With the class that it is a member of.
    re.compile(
        r"^(?!#|//|\s|TEST|TYPED_TEST|INSTANTIATE|using|namespace|template|static_assert)"
        r"[\w:<>,&*\s\[\]]*?\b((?:\w+::)*\w+)\s*(?:\(|=|\{|\[|;)"
    ),
]


# `using testing::HasSubstr;`: may be said twice, but not beside a declaration of that name.
IMPORT = re.compile(r"^using\s+[\w:]*::(\w+);")


def declared_names(path):
    # Declarations that clang-format broke over lines count with their first word line only: hence "as far as".
    names = set()
    for line in path.read_text(encoding="utf-8").splitlines():
        for pattern in DECLARATIONS:
            if match := pattern.match(line):
                names.add("_".join(match.groups()))
                break
    return names


# Headers whose macros are everyday words (Status, None, Bool).
LONERS = re.compile(r"^#include <X11/", re.MULTILINE)
# Headers that do not bear each other's company with GCC.
APART = re.compile(r"^#include [<\"]CGAL/", re.MULTILINE)


def imported_names(path):
    matches = map(IMPORT.match, path.read_text(encoding="utf-8").splitlines())
    return {match.group(1) for match in matches if match}


def groups(paths, most_files):
    """A number for each path; None for those that stay alone."""
    made = []  # (names, imports, how many)
    numbers = []
    for path in paths:
        text = path.read_text(encoding="utf-8")
        if LONERS.search(text) or APART.search(text):
            numbers.append(None)
            continue
        names, imports = declared_names(path), imported_names(path)
        for number, group in enumerate(made):
            clash = names & (group["names"] | group["imports"]) or imports & group["names"]
            if group["files"] < most_files and not clash:
                break
        else:
            number = len(made)
            made.append({"names": set(), "imports": set(), "files": 0})
        made[number]["names"] |= names
        made[number]["imports"] |= imports
        made[number]["files"] += 1
        numbers.append(number)
    return numbers


def main():
    paths = [pathlib.Path(name) for name in sys.argv[2:]]
    for number in groups(paths, int(sys.argv[1])):
        print(-1 if number is None else number)


if __name__ == "__main__":
    main()
