#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Checks the texts that people read against tests/scripts/words.toml: words to avoid, and sentences that are too long.

    tests/scripts/check_words.py [--root DIR] [--table FILE] [FILE...]

Texts are Markdown, string literals of C++, TypeScript and Python, and comments; the
table says of which files. Exit code 0 when nothing is found, 1 otherwise, 2 for wrong use.
"""

import argparse
import fnmatch
import pathlib
import re
import subprocess
import sys
import tomllib

LITERAL = re.compile(r'"((?:[^"\\\n]|\\.)*)"' + r"|`((?:[^`\\]|\\.)*)`")
CODE_BLOCK = re.compile(r"^(```|~~~).*?^\1", re.MULTILINE | re.DOTALL)
INLINE_CODE = re.compile(r"`[^`\n]*`")
LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
# A sentence ends at a semicolon, and at another mark before a space and a capital, a digit or a quote; not within "e.g.".
SENTENCE_END = re.compile(r";(?=\s|$)|(?<![eE]\.g)(?<!i\.e)(?<!vs)[.!?:](?=\s+[\"“A-Z0-9(*]|\s*$)")


class Table:
    """Words to avoid, and the files that are checked."""

    def __init__(self, text):
        data = tomllib.loads(text)
        self.words = [(re.compile(rf"\b(?:{pattern})\b", re.IGNORECASE), advice) for pattern, advice in data["words"].items()]
        self.max_sentence_words = data["max_sentence_words"]
        self.formal = data.get("formal", [])
        self.files = {kind: data.get(kind, []) for kind in ("markdown", "literals", "comments")}

    def covers(self, kind, path):
        return any(fnmatch.fnmatchcase(path, pattern) for pattern in self.files[kind])


def blank(match):
    """As many lines, without their text, so that line numbers stay."""
    return "\n" * match.group(0).count("\n")


def prose_of_markdown(text):
    text = CODE_BLOCK.sub(blank, text)
    text = INLINE_CODE.sub("code", text)
    return LINK.sub(r"\1", text)


def literals_of(text):
    """(line, text) of each string literal with a space in it. Includes are not texts."""
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.lstrip().startswith(("#include", "import ", "//", "*", "/*", "static_assert")):
            for match in LITERAL.finditer(line):
                found = match.group(1) if match.group(1) is not None else match.group(2)
                if " " in found.strip():
                    yield number, found


def comments_of(text, mark):
    """(line, text) of each comment: after `mark`, or a line that begins with an asterisk."""
    for number, line in enumerate(text.splitlines(), start=1):
        if match := re.search(rf"^\s*/?\*+\s(?P<block>.*)|(?:^|\s){mark}\s?(?P<line>.*)", line):
            yield number, match["block"] or match["line"] or ""


def word_errors(table, lines):
    for number, text in lines:
        for pattern, advice in table.words:
            if match := pattern.search(text):
                yield number, f"\"{match.group(0)}\": write {advice}"


def paragraphs_of(text):
    """(line, paragraph) of running text: no tables, headings, or quotations."""
    start, kept = 0, []
    for number, line in enumerate([*text.splitlines(), ""], start=1):
        stripped = line.strip()
        begins_anew = re.match(r"([-*+]|\d+\.)\s", stripped)
        if not stripped or stripped.startswith(("|", "#", ">", "<")) or begins_anew:
            if kept:
                yield start, " ".join(kept)
            kept = []
            if begins_anew:
                start, kept = number, [re.sub(r"^([-*+]|\d+\.)\s", "", stripped)]
            continue
        if not kept:
            start = number
        kept.append(stripped)
    if kept:
        yield start, " ".join(kept)


def sentence_errors(table, text):
    for number, paragraph in paragraphs_of(text):
        for sentence in SENTENCE_END.split(paragraph):
            words = len(sentence.split())
            if words > table.max_sentence_words:
                yield number, f"a sentence of {words} words (at most {table.max_sentence_words}): {' '.join(sentence.split()[:8])} ..."


def errors_of(table, path, text):
    """(line, error) of one file, whose path is relative to the root."""
    errors = []
    if table.covers("markdown", path):
        prose = prose_of_markdown(text)
        errors += word_errors(table, enumerate(prose.splitlines(), start=1))
        if path not in table.formal:
            errors += sentence_errors(table, prose)
    elif path.endswith((".cc", ".h", ".ts", ".py")) and table.covers("literals", path):
        errors += word_errors(table, literals_of(text))
    if not path.endswith(".md") and table.covers("comments", path):
        errors += word_errors(table, comments_of(text, "#+" if path.endswith((".py", ".sh")) else "//+<?"))
    return errors


def main():
    here = pathlib.Path(__file__).resolve().parent
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", type=pathlib.Path, default=here.parent.parent)
    parser.add_argument("--table", type=pathlib.Path, default=here / "words.toml")
    parser.add_argument("files", nargs="*")
    arguments = parser.parse_args()
    try:
        table = Table(arguments.table.read_text(encoding="utf-8"))
    except (OSError, ValueError, KeyError) as error:
        print(f"check_words.py: {arguments.table}: {error}", file=sys.stderr)
        return 2
    files = arguments.files or subprocess.run(["git", "-C", arguments.root, "ls-files"], check=True, capture_output=True, text=True).stdout.splitlines()
    count = 0
    for path in files:
        file = arguments.root / path
        if path.endswith((".md", ".cc", ".h", ".ts", ".py", ".proto", ".sh", ".mjs")) and file.is_file():
            for number, error in errors_of(table, path, file.read_text(encoding="utf-8")):
                print(f"{path}:{number}: {error}", file=sys.stderr)
                count += 1
    if count:
        print(f"check_words.py: {count} texts to rewrite; the words are in {arguments.table}", file=sys.stderr)
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
