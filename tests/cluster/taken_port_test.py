#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A cluster that starts again after another program has taken one of its ports: the port and the program are named, and the other
program is not taken for the cluster's own."""

import pathlib
import socket
import sys
import tempfile
import unittest
import unittest.mock

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "deploy/cluster"))
import processes
import stack
from free_ports import HOST, check_free, free_ports


class TakenPortTest(unittest.TestCase):
    def setUp(self):
        self.other = socket.create_server((HOST, 0))
        self.addCleanup(self.other.close)
        self.port = self.other.getsockname()[1]

    def cluster(self, folder, **ports):
        cluster = stack.Cluster(folder, folder)
        names = ["postgresql", "node1", "gateway1", *stack.PORTS_OF_HAPROXY]
        cluster.state = {"settings": stack.SETTINGS | {"nodes": 1, "gateways": 1}, "processes": {}, "database": {},
                         "ports": dict(zip(names, free_ports(len(names)))) | ports}
        return cluster

    def test_each_program_names_its_port(self):
        for program, place in (("node1", "node1"), ("gateway1", "gateway1"), ("haproxy", "browsers"), ("postgresql", "postgresql")):
            with self.subTest(program), tempfile.TemporaryDirectory() as folder, unittest.mock.patch("free_ports.time.monotonic", side_effect=range(0, 1000, 10)), \
                    unittest.mock.patch.object(processes, "start") as start:
                with self.assertRaisesRegex(SystemExit, f"^{program} cannot listen on {HOST}:{self.port}: Address already in use; .*down"):
                    self.cluster(folder, **{place: self.port}).start(program)
                start.assert_not_called()

    def test_a_port_whose_program_is_just_ending_is_waited_for(self):
        with unittest.mock.patch("free_ports.time.sleep", side_effect=lambda _: self.other.close()) as sleep:
            check_free(self.port, "node1", "")
        sleep.assert_called_once()

    def test_a_free_port_is_taken_at_once(self):
        self.other.close()
        with unittest.mock.patch("free_ports.time.sleep") as sleep:
            check_free(self.port, "node1", "")
        sleep.assert_not_called()


if __name__ == "__main__":
    unittest.main()
