#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Selects the tests that a change can affect, by the dependency graph of the build.

  tests/scripts/select_tests.py tests BUILD_DIR COMMIT [LABELS]      the entries of ctest, one a line
  tests/scripts/select_tests.py targets BUILD_DIR COMMIT [LABELS]    the targets that these entries need, one a line
  tests/scripts/select_tests.py left-out BUILD_DIR COMMIT [LABELS]   the entries that are left out, one a line
  tests/scripts/select_tests.py sanitizer COMMIT                     "tsan", "asan-inputs" or nothing: what the change needs

LABELS: only of entries with a label that this regular expression matches. BUILD_DIR is a configured build; it need not be built. The change is everything that differs from COMMIT in the work tree,
committed or not. An unknown COMMIT, or a changed file that no rule below covers, selects everything.

A source file affects the folders of the .cc files that include it, directly or not, and those the test programs that link
one of these folders or start its program. Other entries of ctest start several programs: any change of a product's
source selects them. Text files affect the tests whose sources name docs/.
"""

import json
import pathlib
import re
import subprocess
import sys

import tidy_selection

SOURCE = re.compile(r"\.(cc|h)$")
TEXT = re.compile(r"(\.md$|^docs/|^LICENSE$)")
PRODUCT = re.compile(r"^(core|proto|server|client)/(?!lab/)")
THREADS = re.compile(r"^(server|proto|client/(cpp|gateway|pacs_bridge))/")
INPUTS = re.compile(r"^(core/(base|mesh|imaging|planning)|client/cli|tests/fuzz)/")
IN_THE_PAGE = ("core/mechanics/answer_evaluator/", "core/base/instruction_set.")  # deploy/build_web.sh compiles it to WebAssembly


class Entry:
    """An entry of ctest: its test program's target ("" where it is a script), the source folder of its tests, whether it
    starts programs of the build, whether it needs the planner, and its labels."""

    def __init__(self, name, target, folder, starts_programs, needs_planner, labels=()):
        self.name, self.target, self.folder, self.labels = name, target, folder, labels
        self.starts_programs, self.needs_planner = starts_programs, needs_planner


def run(*command, cwd=None):
    return subprocess.run(command, check=True, capture_output=True, text=True, cwd=cwd).stdout


def changed_files(root, commit):
    """Paths that differ from the commit; None where the commit is not known here."""
    try:
        listed = run("git", "diff", "--name-only", "--no-renames", "-z", commit, "--", cwd=root)
    except subprocess.CalledProcessError:
        return None
    listed += run("git", "ls-files", "--others", "--exclude-standard", "-z", cwd=root)
    return {path for path in listed.split("\0") if path}


def read_commands(build):
    """{entry: words of its command}. From the files that CMake writes, since ctest reports no command of a program that is not
    built yet."""
    text = "".join(path.read_text(encoding="utf-8") for path in build.rglob("CTestTestfile.cmake"))
    entries = re.findall(r"^add_test\(\[=\[(.+?)\]=\](.*)\)$", text, re.MULTILINE)
    return {name: re.findall(r'"((?:[^"\\]|\\.)*)"', words) for name, words in entries}


def read_entries(build):
    commands = read_commands(build)
    for test in json.loads(run("ctest", "--test-dir", str(build), "--show-only=json-v1"))["tests"]:
        words = commands[test["name"]]
        properties = {each["name"]: each["value"] for each in test["properties"]}
        program = next((pathlib.PurePath(word).name for word in words if word.endswith("_test")), "")
        folder = pathlib.Path(properties["WORKING_DIRECTORY"])
        folder = folder.relative_to(build).as_posix() if folder.is_relative_to(build) else "tests/" + test["name"].split(".")[0]
        starts = not program and (any(str(build / "bin") in word for word in words) or "ENVIRONMENT" in properties)
        yield Entry(test["name"], program, folder, starts, "planner_built" in properties.get("FIXTURES_REQUIRED", []),
                    properties.get("LABELS", []))


def folders_linked(build, target):
    """The folders of the build whose objects, libraries or programs a target is made of."""
    inputs = run("ninja", "-C", str(build), "-t", "inputs", target).splitlines()
    return {path.split("/CMakeFiles/")[0] if "/CMakeFiles/" in path else str(pathlib.PurePath(path).parent)
            for path in inputs if re.match(r"(core|proto|server|client|tests)/", path)}


def include_graph(root, paths):
    """{path: paths it includes}; an include is written from the root or from the file's own folder."""
    graph = {}
    for path in paths:
        names = tidy_selection.INCLUDE.findall((root / path).read_text(encoding="utf-8"))
        graph[path] = {name for include in names for name in (include, str(pathlib.PurePosixPath(path).parent / include))}
    return graph


def rule_of(path):
    """"source", "web", "python", "text", "scripts", "tests" (a file that belongs to the tests of its folder), or "everything"."""
    if path.startswith("client/web/"):
        return "web"
    if path.startswith(("client/python/", "client/slicer/")):
        return "python"
    if TEXT.search(path):
        return "text"
    if SOURCE.search(path):
        return "source"
    if path.startswith(("tests/scripts/", ".ci/")) and not path.endswith("CMakeLists.txt"):
        return "scripts"
    if re.match(r"tests/(?!data/|testing/)", path) and path.endswith((".py", ".ts", ".sh")):
        return "tests"
    return "everything"


def is_selected(entry, rules, sources, links, reads_docs):
    """`rules`: {rule: changed paths}; `sources`: the .cc files that the change reaches."""
    if entry.name.startswith("scripts.") and not entry.starts_programs:
        return True
    if rules.get("web") and (entry.needs_planner or entry.name.startswith(("client_web.", "e2e."))):
        return True
    if rules.get("python") and entry.name.startswith(("client_python.", "client_slicer.")):
        return True
    if any(str(pathlib.PurePosixPath(path).parent) == entry.folder for path in rules.get("tests", ())):
        return True
    if rules.get("text") and reads_docs(entry):
        return True
    if entry.target:
        return not links(entry.target).isdisjoint({str(pathlib.PurePosixPath(path).parent) for path in sources})
    in_own_folder = any(path.startswith(entry.folder + "/") for path in sources)
    return in_own_folder or (entry.starts_programs and any(PRODUCT.search(path) for path in sources))


def select(entries, changed, reach, links, reads_docs):
    """The entries that the changed files affect; all where nothing is known. `reach(paths)` gives the files that include
    them, `links(target)` the folders of a test program, `reads_docs(entry)` whether its tests read texts."""
    rules = {}
    for path in changed or ():
        rules.setdefault(rule_of(path), set()).add(path)
        if path.startswith(IN_THE_PAGE):
            rules.setdefault("web", set()).add(path)
    if changed is None or "everything" in rules:
        return list(entries)
    sources = {path for path in reach(rules.get("source", set())) if path.endswith(".cc")}
    return [entry for entry in entries if is_selected(entry, rules, sources, links, reads_docs)]


def targets_of(selected, entries, labels=""):
    """Everything ("all") where everything is selected; `programs` are those that are not tests."""
    if len(selected) == len(entries) and not labels:
        return ["all"]
    scripts = any(entry.starts_programs or entry.needs_planner for entry in selected)
    return sorted({entry.target for entry in selected if entry.target}) + (["programs"] if scripts else [])


def sanitizer_of(changed):
    """One for each change: threads come first, since a data race is what other tests see least."""
    if changed is None or any(THREADS.search(path) and SOURCE.search(path) for path in changed):
        return "tsan"
    if any(INPUTS.search(path) and SOURCE.search(path) for path in changed):
        return "asan-inputs"
    return ""


def names_docs(root, entry):
    folder = root / entry.folder
    return any("docs/" in path.read_text(encoding="utf-8", errors="replace")
               for path in folder.glob("*") if path.suffix in (".cc", ".h", ".py", ".ts", ".sh"))


def selection(root, build, commit, labels):
    entries = [entry for entry in read_entries(build) if not labels or any(re.search(labels, label) for label in entry.labels)]
    tracked = run("git", "ls-files", "--cached", "--others", "--exclude-standard", "*.cc", "*.h", cwd=root).split()
    graph = include_graph(root, [path for path in tracked if (root / path).is_file()])
    chosen = select(entries, changed_files(root, commit), lambda paths: tidy_selection.reached_from(paths, graph),
                    lambda target: folders_linked(build, target), lambda entry: names_docs(root, entry))
    return entries, chosen


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    arguments = sys.argv[1:]
    if len(arguments) == 2 and arguments[0] == "sanitizer":
        print(sanitizer_of(changed_files(root, arguments[1])))
        return 0
    if len(arguments) not in (3, 4) or arguments[0] not in ("tests", "targets", "left-out"):
        print(__doc__, file=sys.stderr)
        return 2
    entries, chosen = selection(root, pathlib.Path(arguments[1]).resolve(), arguments[2], "".join(arguments[3:]))
    lines = {
        "tests": lambda: [entry.name for entry in chosen],
        "targets": lambda: targets_of(chosen, entries, "".join(arguments[3:])),
        "left-out": lambda: [entry.name for entry in entries if entry not in chosen],
    }[arguments[0]]()
    print("".join(f"{line}\n" for line in lines), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
