# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""`tissueform load --cluster` beside the strangers: drags and followers by client/cpp, which must not report one error."""

import json
import subprocess

import stack

PATIENCE_S = 120
PLAN = stack.ROOT / "tests/data/plans/bar/plan.json"


class OurClients:
    def __init__(self, arena, seconds):
        self.file = arena.cluster.folder / "our_clients.json"
        self.log = arena.cluster.log("our_clients")
        with open(self.log, "wb") as output:
            self.process = subprocess.Popen(
                [arena.cluster.programs / "tissueform", "load", "--server", arena.address, "--cluster", "--plan", PLAN, "--sessions", "3", "--followers",
                 "2", "--rate", "20", "--commit-seconds", "1", "--seconds", str(seconds), "--json", self.file], stdout=output, stderr=output,
                stdin=subprocess.DEVNULL)

    def judge(self, ledger):
        """Waits for their end; what they say in one line."""
        try:
            self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            ledger.violation(f"`tissueform load` does not end; see {self.log}")
            self.stop()
            return "did not end"
        said = json.loads(self.file.read_text()) if self.file.exists() else {}
        if self.process.returncode != 0 or said.get("errors", 1) or said.get("commits_failed", 1):
            ledger.violation(f"`tissueform load` told of errors: {self.log.read_text(errors='replace')[-1500:]}")
        wanted = ("poses_sent", "poses_answered", "commits_sent", "reattachments", "watch_reattachments", "longest_gap_ms", "commits_failed", "errors")
        return ", ".join(f"{key} {said[key]}" for key in wanted if key in said)

    def stop(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
