#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""How often a stranger asks for a session that nobody gives him. No cluster is needed."""

import pathlib
import sys
import unittest
from unittest import mock

sys.path.append(str(pathlib.Path(__file__).resolve().parent))
try:
    import grpc
except ImportError as missing:
    print(f"{missing}; install it: apt-get install python3-grpcio")
    sys.exit(77)
import stranger  # noqa: E402

CALL_S = 0.008
SECONDS = 40
A_FEW_TIMES = 5  # a second
CODES = [grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED, grpc.StatusCode.UNKNOWN, grpc.StatusCode.INTERNAL]


class Error:
    def __init__(self, code, reason, node=""):
        self.why = (code, reason, {"node": node} if node else {})

    @staticmethod
    def details():
        return "refused"


class Pace(unittest.TestCase):
    def setUp(self):
        self.now = 100.0
        self.route = stranger.Route("0123456789abcdef")
        for patch in (mock.patch.object(stranger, "why", lambda error: error.why), mock.patch.object(stranger.time, "monotonic", lambda: self.now)):
            patch.start()
            self.addCleanup(patch.stop)

    def tries(self, *errors, stream_lasts_s=None):
        """In 40 s, by a client that does what the route says, of calls that end with these errors in turn. `stream_lasts_s`: streams
        begin, and end so after so long."""
        count, end = 0, self.now + SECONDS
        while self.now < end and count < 10_000:
            count += 1
            self.now += CALL_S
            if stream_lasts_s is not None:
                self.route.answered(())
                self.now += stream_lasts_s
            self.now += self.route.failed(errors[count % len(errors)])
        return count

    def test_streams_that_begin_and_end_are_not_opened_without_pause(self):
        for code in CODES:
            with self.subTest(code=code):
                self.assertLess(self.tries(Error(code, "SESSION_MOVED"), stream_lasts_s=0), A_FEW_TIMES * SECONDS)

    def test_nor_is_a_session_that_nobody_holds_asked_for(self):
        for reason in ("SESSION_MOVED", "WRONG_NODE", "SERVER_DRAINING", ""):
            with self.subTest(reason=reason):
                self.assertLess(self.tries(Error(grpc.StatusCode.CANCELLED, reason)), A_FEW_TIMES * SECONDS)

    def test_servers_that_name_each_other_are_asked_a_few_times_between_waits(self):
        self.assertLess(self.tries(Error(grpc.StatusCode.UNAVAILABLE, "SESSION_MOVED", "node1"), stream_lasts_s=0), (stranger.MOST_HOPS + 1) * A_FEW_TIMES * SECONDS)

    def test_a_server_that_is_named_and_knows_nobody_is_not_asked_without_pause(self):
        moved = [Error(grpc.StatusCode.CANCELLED, "SESSION_MOVED", node) for node in ("node1", "")]
        self.assertLess(self.tries(*moved), 2 * A_FEW_TIMES * SECONDS)

    def test_after_a_stream_that_lasted_the_next_is_opened_at_once(self):
        moved = Error(grpc.StatusCode.CANCELLED, "SESSION_MOVED")
        for _ in range(3):
            self.route.answered(())
            self.now += stranger.LASTING_S
            self.assertEqual(self.route.failed(moved), 0)

    def test_what_is_the_calls_own_fault_is_refused(self):
        for code, reason in ((grpc.StatusCode.NOT_FOUND, "SESSION_NOT_FOUND"), (grpc.StatusCode.CANCELLED, "STALE_ETAG")):
            with self.subTest(code=code), self.assertRaises(stranger.Refused):
                self.route.failed(Error(code, reason))


if __name__ == "__main__":
    unittest.main()
