#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What chaos.py must see: losses, two owners at once, and drags that rest for too long. No cluster is needed."""

import contextlib
import io
import pathlib
import sys
import time
import types
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "deploy/cluster"))
sys.path.append(str(ROOT / "tests/cluster"))
import arena  # noqa: E402
import ledger  # noqa: E402

SESSION = "sessions/0123456789abcdef"


def stream(node):
    return types.SimpleNamespace(node=node, server=node, drag=types.SimpleNamespace(session=SESSION), first_frame_at=None, sent_at={})


def send(sender, *sequences):
    for sequence in sequences:
        sender.sent_at[sequence] = time.monotonic()


class Ledger(unittest.TestCase):
    def setUp(self):
        self.ledger = ledger.Ledger()
        silence = contextlib.redirect_stdout(io.StringIO())
        silence.__enter__()
        self.addCleanup(silence.__exit__, None, None, None)

    def test_one_owner_after_the_other_is_right(self):
        for node in ("node1", "node2", "node1"):
            owner = stream(node)
            send(owner, 1, 2)
            self.ledger.frame(owner, 1)
            self.ledger.committed(owner, 2, "")
        self.assertEqual(self.ledger.violations, [])

    def test_a_pose_that_was_sent_after_the_next_owner_had_answered_may_not_be_answered(self):
        old, new = stream("node1"), stream("node2")
        send(old, 1)
        self.ledger.frame(old, 1)
        self.ledger.frame(new, 2)
        send(old, 3)
        self.ledger.frame(old, 3)
        self.assertEqual(len(self.ledger.violations), 1)

    def test_nor_may_a_commit_be_kept(self):
        old, new = stream("node1"), stream("node2")
        send(old, 1)
        self.ledger.frame(old, 1)
        self.ledger.frame(new, 2)
        send(old, 3)
        self.ledger.committed(old, 3, "")
        self.assertEqual(len(self.ledger.violations), 1)

    def test_a_frame_that_was_on_its_way_is_no_second_owner(self):
        old, new = stream("node1"), stream("node2")
        send(old, 1, 2)
        self.ledger.frame(old, 1)
        self.ledger.frame(new, 3)
        self.ledger.frame(old, 2)
        self.assertEqual(self.ledger.violations, [])

    def test_but_one_that_comes_long_after_is(self):
        old, new = stream("node1"), stream("node2")
        send(old, 1, 2)
        self.ledger.frame(old, 1)
        self.ledger.frame(new, 3)
        new.first_frame_at -= 1
        old.first_frame_at -= 2
        self.ledger.frame(old, 2)
        self.assertEqual(len(self.ledger.violations), 1)

    def test_a_commit_that_was_refused_is_not_acknowledged(self):
        owner = stream("node1")
        self.ledger.committed(owner, 5, "the store does not answer")
        self.assertEqual(self.ledger.committed_to, {})


class Rest(unittest.TestCase):
    """Of a drag that was killed at 100 s, with preparations of 0.5 s."""

    def setUp(self):
        self.arena = arena.Arena.__new__(arena.Arena)
        self.arena.lock = contextlib.nullcontext()
        self.arena.events = []

    def until(self, begin, end):
        return self.arena.may_rest_until(SESSION, begin, end, 0.5)

    def test_without_cause_a_preparation_and_a_second(self):
        self.assertEqual(self.until(100, 120), 101.5)

    def test_a_lease_after_its_server_was_killed(self):
        self.arena.events = [arena.Event(100.1, "kill -9 node1", {SESSION})]
        self.assertAlmostEqual(self.until(100, 120), 111.6)

    def test_not_a_lease_when_another_server_was_killed(self):
        self.arena.events = [arena.Event(100.1, "kill -9 node1", {"sessions/fedcba9876543210"})]
        self.assertEqual(self.until(100, 120), 101.5)

    def test_until_haproxy_is_back(self):
        self.arena.events = [arena.Event(100.1, "kill -9 haproxy", stops_all=True, back_at=103)]
        self.assertEqual(self.until(100, 120), 104.5)

    def test_what_was_long_ago_does_not_count(self):
        self.arena.events = [arena.Event(90, "kill -9 node1", {SESSION}, back_at=92)]
        self.assertEqual(self.until(100, 120), 101.5)


if __name__ == "__main__":
    unittest.main()
