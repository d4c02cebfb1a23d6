#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Prints the rooms of the tree: how many units every folder has and how large they are.

    tests/scripts/print_rooms.py [--root DIR | --revision REV]

A room is a folder with source files below core, proto, server or client. A unit is a .h and the .cc of its name,
or one of them alone. Comments: the share of lines of .cc files that begin with //, without the two-line heads.
--revision reads a commit instead of the files at hand.
"""

import argparse
import pathlib
import statistics
import subprocess
import sys

TOPS = ("core", "proto", "server", "client")
SUFFIXES = (".h", ".cc")
CRUMB_LINES = 60
HEAD_LINES = 2


def files_at_hand(root):
    """(path from the root, text) of every source file."""
    for top in TOPS:
        for path in sorted((root / top).rglob("*")):
            if path.suffix in SUFFIXES:
                yield path.relative_to(root), path.read_text(encoding="utf-8")


def files_of_revision(root, revision):
    """The same, of a commit."""
    def git(*words):
        return subprocess.run(["git", "-C", root, *words], check=True, capture_output=True, text=True).stdout
    for name in git("ls-tree", "-r", "--name-only", "--full-tree", revision, "--", *TOPS).splitlines():
        path = pathlib.PurePosixPath(name)
        if path.suffix in SUFFIXES:
            yield path, git("show", f"{revision}:{name}")


class Room:
    """What is counted of a folder, or of all."""

    def __init__(self):
        self.units = {}  # path without suffix -> lines
        self.code_lines = 0  # of .cc files, without their heads
        self.comment_lines = 0

    def add(self, path, text):
        lines = text.splitlines()
        unit = path.with_suffix("").as_posix()
        self.units[unit] = self.units.get(unit, 0) + len(lines)
        if path.suffix == ".cc":
            body = lines[HEAD_LINES:]
            self.code_lines += len(body)
            self.comment_lines += sum(line.lstrip().startswith("//") for line in body)

    def median(self):
        return statistics.median(self.units.values())

    def row(self, name):
        sizes = self.units.values()
        comments = 100 * self.comment_lines / self.code_lines if self.code_lines else 0
        return (f"{name:26}{len(sizes):6}{sum(sizes):8}{self.median():8.0f}{max(sizes):9}"
                f"{sum(size < CRUMB_LINES for size in sizes):10}{comments:11.1f} %")


def count(files):
    """(rooms by folder, all of them as one)."""
    rooms, house = {}, Room()
    for path, text in files:
        rooms.setdefault(path.parent.as_posix(), Room()).add(path, text)
        house.add(path, text)
    return rooms, house


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parents[2])
    parser.add_argument("--revision", help="read this commit instead of the files at hand")
    arguments = parser.parse_args()
    files = (files_of_revision(arguments.root, arguments.revision) if arguments.revision
             else files_at_hand(arguments.root))
    try:
        rooms, house = count(files)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"print_rooms.py: {(getattr(error, 'stderr', None) or str(error)).strip()}", file=sys.stderr)
        return 2
    if not rooms:
        print(f"print_rooms.py: no source file below {', '.join(TOPS)} of {arguments.root}", file=sys.stderr)
        return 2
    print(f"{'room':26}{'units':>6}{'lines':>8}{'median':>8}{'largest':>9}{'below ' + str(CRUMB_LINES):>10}{'comments':>13}")
    for name, room in sorted(rooms.items()):
        print(room.row(name))
    print(house.row(f"all {len(rooms)} rooms"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
