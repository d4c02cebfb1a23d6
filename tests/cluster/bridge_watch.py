#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The PACS bridge behind HAProxy: the server on which it hears of exports is killed, and it hears of the next one all the same.

Exit code 0: so it was. 1: not. 77: PostgreSQL, HAProxy or python3-grpcio is missing.
"""

import argparse
import contextlib
import pathlib
import random
import re
import sqlite3
import sys
import time
import uuid

ROOT = pathlib.Path(__file__).resolve().parents[2]
for folder in ("deploy/cluster", "tests/integration"):
    sys.path.append(str(ROOT / folder))
SKIPPED = 77

import balancer  # noqa: E402 (after the paths)
import processes  # noqa: E402
import stack  # noqa: E402

try:
    import drags
    import ledger as ledger_module
    import maker
    import stranger
except ImportError as missing:
    print(f"{missing}; install it: apt-get install python3-grpcio python3-protobuf")
    sys.exit(SKIPPED)

CASE = "cases/" + "c0" * 32
PATIENCE_S = 30  # two waits of the bridge's, and a machine that is busy
BRIDGE = "bridge"
CONFIRMATION = 2  # ExportState: the bridge has taken it and waits for a person


def until(what, condition):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f"{what}: not within {PATIENCE_S} s")
        time.sleep(0.05)


class Bridge:
    """tissueform-pacs, whose queue knows the case; there is no PACS."""

    def __init__(self, cluster):
        self.cluster, self.folder = cluster, cluster.folder / BRIDGE
        self.process = None

    def start(self):
        command = [self.cluster.programs / "tissueform-pacs", "run", "--state-dir", self.folder, "--listen", f"{processes.HOST}:0", "--no-review",
                   "--allow-ae", "SCANNER", "--recipe", ROOT / "tests/pacs/recipe.json", "--pacs", f"{processes.HOST}:1", "--pacs-ae-title", "PACS",
                   "--server", self.cluster.address("workstations")]
        self.process = processes.start(command, self.cluster.log(BRIDGE))

    def stop(self):
        if self.process is not None:
            processes.stop(self.process)

    def begin(self):
        """With a queue in which the case stands as published."""
        self.start()
        processes.wait_for("the bridge", (self.folder / "queue.db").exists, self.process, self.cluster.log(BRIDGE))
        until("the queue", self._has_tables)
        self.stop()
        with contextlib.closing(sqlite3.connect(self.folder / "queue.db")) as queue, queue:
            queue.execute("INSERT INTO studies VALUES ('1.2.3', '1', '', 'A', '', 1, '', '')")
            queue.execute("INSERT INTO series VALUES (?, '1.2.3', '1.2.3.4', '1.2.3.5', 'CT', 'published', '', '', ?, 0, '', 1, 1, 0, 0)", (uuid.uuid4().hex, CASE))
        self.start()

    def _has_tables(self):
        try:
            with contextlib.closing(sqlite3.connect(f"file:{self.folder}/queue.db?mode=ro", uri=True)) as queue:
                return queue.execute("SELECT COUNT(*) FROM sqlite_master WHERE name = 'series'").fetchone()[0] == 1
        except sqlite3.Error:
            return False


class Planner:
    """Asks for exports, as a page would."""

    def __init__(self, cluster):
        self.maker = maker.Maker(cluster.address("workstations"), ledger_module.Ledger(), random.Random(1))
        mesh, _ = self.maker.new_mesh()
        self.session = self.maker.new_session(mesh)

    def predict(self):
        """The name of a new prediction."""
        from tissueform.v1 import prediction_pb2, prediction_service_pb2 as protocol
        request = protocol.CreatePredictionRequest(session=self.session, request_id=uuid.uuid4().hex, case=CASE, poses=[{"handle": drags.HANDLE}])
        return self.maker.server.call("PredictionService/CreatePrediction", request, prediction_pb2.Prediction,
                                      stranger.Route(self.session.removeprefix("sessions/"))).name

    def ask(self, prediction):
        """The name of its export."""
        from tissueform.v1 import export_service_pb2 as protocol
        request = protocol.CreateExportRequest(prediction=prediction, request_id=uuid.uuid4().hex)
        return self.maker.server.call("ExportService/CreateExport", request, protocol.Export).name

    def is_taken(self, name):
        from tissueform.v1 import export_service_pb2 as protocol
        return self.maker.server.call("ExportService/GetExport", protocol.GetExportRequest(name=name), protocol.Export).state == CONFIRMATION


def watched(cluster):
    """The server on which the bridge hears of exports: of all calls through HAProxy its watch alone lasts."""
    found = re.findall(r"be=servers srv=(\S+)", balancer.send_command(cluster, "show sess") or "")
    return found[0] if len(found) == 1 else None


def run(cluster, bridge):
    cluster.up()
    bridge.begin()
    planner = Planner(cluster)
    predictions = [planner.predict(), planner.predict()]
    first = planner.ask(predictions[0])
    until("the bridge takes an export", lambda: planner.is_taken(first))
    planner.maker.server.close()
    until("the watch of the bridge is found", lambda: watched(cluster) is not None)
    victim = watched(cluster)
    print(f"the bridge hears of exports on {victim}", flush=True)
    cluster.kill(victim)
    processes.wait_until_gone(cluster.process(victim))
    planner.maker.server = stranger.Stranger(cluster.address("workstations"))
    begin, second = time.monotonic(), planner.ask(predictions[1])
    until("the bridge takes an export that was asked for after its server was killed", lambda: planner.is_taken(second))
    print(f"{victim} was killed; the next export was asked for and taken within {time.monotonic() - begin:.1f} s", flush=True)
    if not processes.is_running(bridge.process):
        raise SystemExit("the bridge has ended")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", required=True)
    parser.add_argument("--state", required=True, metavar="FOLDER")
    options = parser.parse_args()
    missing_programs = stack.missing_programs()
    if missing_programs:
        print("\n".join(missing_programs))
        sys.exit(SKIPPED)
    stranger.import_protocol(ROOT / "proto")
    cluster = stack.Cluster(options.state, options.programs)
    if cluster.exists:
        cluster.down()
    cluster.make(nodes=2, gateways=1)
    bridge = Bridge(cluster)
    try:
        run(cluster, bridge)
    except BaseException:
        print(cluster.log(BRIDGE).read_text(errors="replace")[-3000:] if cluster.log(BRIDGE).exists() else "the bridge has said nothing")
        raise
    finally:
        bridge.stop()
        cluster.down()


if __name__ == "__main__":
    main()
