# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Programs are killed while the bridge stands at a place that it names (tests/pacs/halting_hook.cc), so that it is known which
step was in flight."""

import signal

import stack

# In the order in which they are passed.
PLAN_POINTS = ["plan.linked", "plan.built", "plan.packed", "plan.publishing", "plan.published"]
EXPORT_POINTS = ["export.asked", "export.header", "export.uids", "export.files", "export.sending", "export.transferred", "export.marked", "export.told"]
BRIDGE, OTHERS = ["bridge"], ["server", "orthanc"]


class Halts:
    """From now on the bridge stops where it is wanted to. Start it anew afterwards."""

    def __init__(self, programs):
        self.programs, self.folder, self.kills = programs, programs.folder / "halts", []
        self.folder.mkdir()
        programs.bridge_program = programs.programs / "tissueform-pacs-halting"
        programs.environment = stack.QUICK | {"TISSUEFORM_HALT_DIR": str(self.folder)}

    def want(self, point):
        (self.folder / "reached").unlink(missing_ok=True)
        fresh = self.folder / "fresh"
        fresh.write_text(point)
        fresh.rename(self.folder / "want")

    def kill_at(self, point, victims, then=None):
        """Waits until the bridge stands at a place that was wanted, kills as the power switch would, and lets all of it go on, to `then`."""
        bridge = self.programs.running["bridge"]
        self.programs.wait_for(f"the bridge at {point}", lambda: (self.folder / "reached").exists() and stack.state_of(bridge.pid) == "T",
                               patience_s=4 * stack.PATIENCE_S, needs="bridge")
        for victim in victims:
            self.programs.stop(victim, signal.SIGKILL)
            self.kills.append((point, victim))
        if then is not None:
            self.want(then)
        if "bridge" in victims:
            self.programs.start_bridge(wait=then is None)  # it may stand there before it listens
            return
        bridge.send_signal(signal.SIGCONT)  # its connections are broken, and no server answers yet
        self.programs.start_server()
        self.programs.start_orthanc()
