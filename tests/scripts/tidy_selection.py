#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Which source files clang-tidy has to see again: those that have changed since it last passed, and all that include a
changed header. Everything when that is not known, or when something has changed that concerns them all.

  tests/scripts/tidy_selection.py select [PASSED.json]   prints the .cc files, one a line; why, on stderr
  tests/scripts/tidy_selection.py state                  prints the state of the tree, which is kept as PASSED.json when
                                                         clang-tidy passes

TISSUEFORM_TIDY_BASE  a commit that passed, instead of PASSED.json

A state is the version of clang-tidy and Git's number of the contents of each file, committed or not: it holds for every
checkout of the machine, and a file that has been changed back has not changed.
"""

import json
import os
import pathlib
import re
import subprocess
import sys

# Files that say how others are compiled or checked, or that generate sources.
CONCERNS_ALL = re.compile(
    r"(^|/)(CMakeLists\.txt|CMakePresets\.json|\.clang-tidy)$|\.(cmake|proto|in)$|\.schema\.json$"
    r"|^cmake/|^deploy/packages\.txt$|^tests/scripts/(check_tidy\.sh|tidy_batches\.py|tidy_selection\.py)$"
)
SOURCE = re.compile(r"\.(cc|h)$")
INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)


def git(root, *arguments, text_in=None):
    result = subprocess.run(["git", "-C", str(root), *arguments], check=True, capture_output=True, text=True, input=text_in)
    return result.stdout


def of_interest(path):
    """The examples in docs and what browsers run are projects of their own, which this build's commands do not know."""
    return not path.startswith(("docs/", "client/web/")) and bool(SOURCE.search(path) or CONCERNS_ALL.search(path))


def contents_of_tree(root):
    """{path: Git's number of its contents} of the files that are there, committed or not."""
    listed = git(root, "ls-files", "-z", "--cached", "--others", "--exclude-standard").split("\0")
    paths = sorted({path for path in listed if path and of_interest(path) and (root / path).is_file()})
    numbers = git(root, "hash-object", "--stdin-paths", text_in="".join(f"{path}\n" for path in paths)).split()
    return dict(zip(paths, numbers))


def contents_of_commit(root, commit):
    contents = {}
    for entry in git(root, "ls-tree", "-r", "-z", commit).split("\0"):
        if entry:
            about, path = entry.split("\t", 1)
            if of_interest(path):
                contents[path] = about.split()[2]
    return contents


def reached_from(changed, includes):
    """The changed files and all that include one of them, directly or not; `includes`: {path: paths that it includes}."""
    included_by = {}
    for path, headers in includes.items():
        for header in headers:
            included_by.setdefault(header, set()).add(path)
    reached = set()
    waiting = list(changed)
    while waiting:
        path = waiting.pop()
        if path not in reached:
            reached.add(path)
            waiting.extend(included_by.get(path, ()))
    return reached


def select(before, now, includes_of):
    """(paths of .cc files, why). `before` is None when nothing is known; `includes_of(path)` gives the names in a file's
    #include "..." lines."""
    sources = sorted(path for path in now if path.endswith(".cc"))
    if before is None:
        return sources, "nothing is known of an earlier run"
    changed = {path for path in before.keys() | now.keys() if before.get(path) != now.get(path)}
    for path in sorted(changed):
        if CONCERNS_ALL.search(path):
            return sources, f"{path} concerns all"
    # Relative to the root, as the house writes them, or beside the file.
    includes = {path: {name for include in includes_of(path) for name in (include, str(pathlib.PurePosixPath(path).parent / include))}
                for path in now if SOURCE.search(path)}
    reached = reached_from(changed, includes)
    return [path for path in sources if path in reached], f"{len(changed)} files have changed"


def version():
    return subprocess.run(["clang-tidy", "--version"], check=True, capture_output=True, text=True).stdout.split()


def state(root):
    return {"clang_tidy": version(), "contents": contents_of_tree(root)}


def contents_before(root, passed):
    """What passed; None where that is not known."""
    if base := os.environ.get("TISSUEFORM_TIDY_BASE"):
        return contents_of_commit(root, base)
    try:
        known = json.loads(pathlib.Path(passed).read_text(encoding="utf-8"))
        return known["contents"] if known["clang_tidy"] == version() else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    if sys.argv[1:] == ["state"]:
        json.dump(state(root), sys.stdout)
    elif sys.argv[1:2] == ["select"] and len(sys.argv) <= 3:
        chosen, why = select(contents_before(root, (sys.argv[2:] or [os.devnull])[0]), contents_of_tree(root),
                             lambda path: INCLUDE.findall((root / path).read_text(encoding="utf-8")))
        print(f"tidy_selection.py: {len(chosen)} source files: {why}", file=sys.stderr)
        print("".join(f"{path}\n" for path in chosen), end="")
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
