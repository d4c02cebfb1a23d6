# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Runs `tissueform plan build` as a child that a timer polls: threads of Python may wait while 3D Slicer is idle."""

from __future__ import annotations

import json
import os
import pathlib
import re
import shutil
import subprocess
from typing import List, Mapping, Optional, Sequence

from .errors import SceneError

_PROGRESS = re.compile(r"\[ *(\d+) % +[\d.]+ s\] (.*)")
_ERROR = "tissueform: "


def find_program(setting: str) -> pathlib.Path:
    """The program `tissueform`: the setting, or what PATH has. Raises SceneError."""
    found = shutil.which(os.path.expanduser(setting) or "tissueform")
    if found is None:
        where = f"there is no program {setting}" if setting else "there is no program tissueform in PATH"
        raise SceneError(f"{where}: install the package tissueform, or set its path under Programs")
    return pathlib.Path(found).resolve()


def new_folder(path: str) -> pathlib.Path:
    """An empty folder for a plan and what it is made of. Raises SceneError."""
    if not path:
        raise SceneError("no folder is chosen for the plan: choose a new or an empty one")
    folder = pathlib.Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise SceneError("the folder for the plan is not empty: choose a new or an empty one")
    except OSError as error:
        raise SceneError(f"cannot use the folder for the plan: {error.strerror}") from error
    return folder


class PlanBuild:
    """One run. folder: has what the arguments name; the plan comes into folder/plan. End it with poll or cancel."""

    def __init__(self, program: pathlib.Path, folder: pathlib.Path, arguments: Sequence[str],
                 environment: Optional[Mapping[str, str]] = None) -> None:
        self.plan = folder / "plan"
        self._log = folder / "build.log"
        command = [str(program), "plan", "build", *arguments, "--out", str(self.plan), "--no-pictures", "--accept-defects"]
        with open(self._log, "wb") as log:
            try:
                self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=folder, env=environment)
            except OSError as error:
                raise SceneError(f"cannot start {program}: {error.strerror}") from error

    def _lines(self) -> List[str]:
        return self._log.read_text(encoding="utf-8", errors="replace").splitlines()

    def progress(self) -> str:
        """The newest stage, with the share that is done in percent."""
        stages = [found for found in map(_PROGRESS.match, self._lines()) if found]
        return f"{stages[-1][1]} %: {stages[-1][2]}" if stages else "starting"

    def poll(self) -> bool:
        """Whether the plan is done. Raises SceneError with the program's message if it has failed."""
        code = self._process.poll()
        if code is None:
            return False
        if code != 0:
            messages = [line[len(_ERROR):] for line in self._lines() if line.startswith(_ERROR)]
            raise SceneError(messages[-1] if messages else f"tissueform plan build ended with code {code}: see build.log in the plan's folder")
        return True

    def cancel(self) -> None:
        """Ends it; nothing of the plan remains."""
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait()


def defects_of(plan_folder: pathlib.Path) -> List[str]:
    """Requirements that the plan misses, a line each, by its report; empty: the plan is ready."""
    try:
        report = json.loads((plan_folder / "report.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise SceneError("the plan has no report.json: open a folder that `tissueform plan build` has written") from error
    return [f'{row["requirement"]}: {row["measured"]}' for row in report.get("quality", []) if not row["passed"]]
