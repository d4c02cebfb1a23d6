#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""docs/scaling_model.py: its formulas against simulated queues, its tables against docs/scaling.md."""

import contextlib
import heapq
import io
import json
import math
import pathlib
import random
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "docs"))
sys.dont_write_bytecode = True
import scaling_model as model

FIGURES = ROOT / "docs/results/cluster_load.json"


def simulated_wait_p99(streams, utilisation, cores):
    """In jobs of one second: streams in phase with nobody, first come first served."""
    random.seed(7)
    period = streams / (utilisation * cores)
    waits = []
    for _ in range(400):
        free = [0.0] * cores
        phases = sorted(random.uniform(0, period) for _ in range(streams))
        for turn in range(4):
            for phase in phases:
                now = turn * period + phase
                begin = max(now, heapq.heappop(free))
                heapq.heappush(free, begin + 1)
                if turn == 3:
                    waits.append(begin - now)
    return sorted(waits)[int(0.99 * len(waits))]


def run(words):
    printed = io.StringIO()
    before, sys.argv = sys.argv, ["scaling_model.py", *map(str, words)]
    try:
        with contextlib.redirect_stdout(printed):
            return model.main(), printed.getvalue()
    finally:
        sys.argv = before


class ScalingModelTest(unittest.TestCase):
    def test_waits_are_those_of_periodic_streams(self):
        for streams, utilisation in ((20, 0.7), (50, 0.8), (100, 0.9)):
            simulated = simulated_wait_p99(streams, utilisation, 1)
            self.assertAlmostEqual(model.wait_p99(streams, utilisation, 1), simulated, delta=0.3 * simulated + 0.5)

    def test_more_cores_are_one_faster_one(self):
        simulated = simulated_wait_p99(200, 0.9, 4)
        self.assertAlmostEqual(model.wait_p99(200, 0.9, 1, 4), simulated, delta=0.3 * simulated + 0.5)

    def test_waits_of_one_server_by_erlang_are_exponential(self):
        self.assertAlmostEqual(model.erlang_wait_p99(0.8, 1, 1), math.log(100 * 0.8) / 0.2)

    def test_a_server_is_never_promised_more_than_it_has(self):
        for cores in (1, 4, 16):
            streams = model.most_streams(0.0005, 60, cores)
            self.assertLess(streams * 60 * 0.0005, cores)
            self.assertLessEqual(model.wait_p99(streams, streams * 60 * 0.0005 / cores, 0.0005, cores) + 0.0005, model.LATE_S)

    def test_limits_are_those_of_the_files_that_they_are_from(self):
        server = (ROOT / "deploy/kubernetes/server.yaml").read_text()
        self.assertIn(f"--max-streams={model.STREAMS}\n", server)
        self.assertIn(f"--max-watches={model.WATCHES}\n", server)
        self.assertIn(f"| `--max-sockets` | {model.SOCKETS} |", (ROOT / "docs/gateway.md").read_text())
        self.assertIn(f"    maxconn {model.PROXY_CONNECTIONS}\n", (ROOT / "deploy/haproxy/cluster.cfg").read_text())

    def test_the_document_holds_what_is_printed(self):
        code, printed = run(["--check", ROOT / "docs/scaling.md"])
        self.assertEqual(code, 0, printed)

    def test_other_figures_are_another_document(self):
        figures = json.loads(FIGURES.read_text())
        for each in figures["runs"]:
            each["frames_per_second"] *= 0.5
        with tempfile.TemporaryDirectory() as folder:
            other = pathlib.Path(folder) / "other.json"
            other.write_text(json.dumps(figures))
            code, printed = run(["--figures", other, "--check", ROOT / "docs/scaling.md"])
        self.assertEqual(code, 1)
        self.assertIn("Measured, and modelled", printed)


if __name__ == "__main__":
    unittest.main()
