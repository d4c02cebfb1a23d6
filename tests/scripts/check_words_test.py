#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The words check finds what it is there to find, and nothing in code or in tables."""

import unittest

import check_words

TABLE = check_words.Table("""
max_sentence_words = 6
markdown = ["*.md"]
literals = ["server/*"]
comments = ["*.proto", "core/*"]
[words]
"anew" = "again"
"(?:is|are) told" = "is reported"
""")


class CheckWordsTest(unittest.TestCase):

    def errors(self, path, text):
        return check_words.errors_of(TABLE, path, text)

    def test_finds_words_in_markdown_at_their_line(self):
        self.assertEqual(self.errors("a.md", "Fine.\n\nStart Anew.\n"), [(3, '"Anew": write again')])
        self.assertEqual([number for number, _ in self.errors("a.md", "The user is\ntold. It is told.\n")], [2])

    def test_leaves_code_and_parts_of_words_out(self):
        self.assertEqual(self.errors("a.md", "Run `anew`.\n```\nanew\n```\nAn anewton.\n"), [])

    def test_finds_long_sentences_over_several_lines(self):
        (number, error), = self.errors("a.md", "One two three. One two three four\nfive six seven. One.\n")
        self.assertEqual(number, 1)
        self.assertIn("7 words", error)

    def test_reads_neither_tables_nor_headings_as_sentences(self):
        self.assertEqual(self.errors("a.md", "# one two three four five six seven\n| one two three four | five six seven |\n"), [])

    def test_takes_an_item_of_a_list_for_a_paragraph(self):
        self.assertEqual(self.errors("a.md", "- one two three four\n- five six seven\n"), [])

    def test_finds_words_in_literals_alone(self):
        self.assertEqual(self.errors("server/a.cc", '// anew\nError("start anew");\n'), [(2, '"anew": write again')])
        self.assertEqual(self.errors("server/a.cc", 'Set("anew");\n#include "anew is.h"\n'), [])
        self.assertEqual(self.errors("client/a.cc", 'Error("start anew");\n'), [])

    def test_finds_words_in_comments_of_the_protocol(self):
        self.assertEqual(self.errors("a.proto", "// What is told.\nstring anew = 1;\n"), [(1, '"is told": write is reported')])

    def test_finds_words_in_comments_of_code(self):
        self.assertEqual(self.errors("core/a.cc", "int a;  // anew\nint anew;\n"), [(1, '"anew": write again')])
        self.assertEqual(self.errors("core/a.ts", "/**\n * What is told.\n */\nconst b = a * anew;\n"), [(2, '"is told": write is reported')])
        self.assertEqual(self.errors("core/a.py", "anew = 1\n# anew\n"), [(2, '"anew": write again')])


if __name__ == "__main__":
    unittest.main()
