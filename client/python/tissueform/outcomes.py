# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Predictions against operated faces, by the command `tissueform outcome` of this machine."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
from typing import Any, Dict, List, Optional, Sequence

from ._channel import PathLike
from ._programs import find_program
from .errors import InvalidInput

_ERROR = "tissueform: "
_NOTHING_SAID = "tissueform outcome failed without a message"


def _flags(*, models: Sequence[str], calibrate: bool, accept_findings: bool, pictures: bool) -> List[str]:
    if isinstance(models, str):
        raise InvalidInput(f"models is a list of names, not {models!r}", advice=f"give models=[{models!r}]")
    flags = [word for model in models for word in ("--model", model)]
    wanted = {"--calibrate": calibrate, "--accept-findings": accept_findings, "--no-pictures": not pictures}
    return flags + [flag for flag, is_wanted in wanted.items() if is_wanted]


def _error_of(stderr: str) -> str:
    lines = [line[len(_ERROR):] for line in stderr.splitlines() if line.startswith(_ERROR)]
    return lines[-1] if lines else _NOTHING_SAID


def _run(program: Optional[PathLike], words: Sequence[PathLike]) -> "subprocess.CompletedProcess[str]":
    command = [str(find_program("tissueform", program)), "outcome", *(os.fspath(word) for word in words)]
    return subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace",
                          check=False)


def _read(path: pathlib.Path) -> Dict[str, Any]:
    read: Dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return read


def outcome(pre: PathLike, post: PathLike, out: PathLike, *, post_bone: Optional[PathLike] = None, post_axes: str = "LPS",
            post_labels: Optional[PathLike] = None, post_recipe: Optional[PathLike] = None, models: Sequence[str] = (), calibrate: bool = False,
            accept_findings: bool = False, pictures: bool = True, program: Optional[PathLike] = None) -> Dict[str, Any]:
    """Compares what the models predict for a plan with the face after the operation; takes minutes for a whole CT.

    pre: plan.json of `plan build`, or a case (.tfcase). post: a CT, or a surface of the skin in mm. out: a new or an empty folder, which
    gets outcome.html, outcome.json and pictures; they show a face. post_bone: with a surface, the surface of all bone. post_axes: where the
    axes of surfaces grow toward. models: their names (default: all). calibrate, accept_findings: docs/outcome.md. pictures: False needs no
    display. program: path of `tissueform` (default: the environment's TISSUEFORM_PROGRAM, or the one in PATH).

    Returns outcome.json (docs/outcome.schema.json). Errors: NotFound (no such program), InvalidInput (what the command says, in one line).
    """
    words: List[PathLike] = ["--pre", pre, "--post", post, "--out", out]
    given = {"--post-bone": post_bone, "--post-labels": post_labels, "--post-recipe": post_recipe}
    for option, value in given.items():
        words += [] if value is None else [option, value]
    words += ["--post-axes", post_axes]
    words += _flags(models=models, calibrate=calibrate, accept_findings=accept_findings, pictures=pictures)
    ended = _run(program, words)
    if ended.returncode != 0:
        raise InvalidInput(_error_of(ended.stderr))
    return _read(pathlib.Path(out) / "outcome.json")


def outcome_cohort(patients: PathLike, out: PathLike, *, models: Sequence[str] = (), calibrate: bool = False, accept_findings: bool = False,
                   pictures: bool = True, jobs: int = 0, program: Optional[PathLike] = None) -> Dict[str, Any]:
    """The same for the patients of a CSV file, restartable: the same call again continues where it was interrupted.

    patients: a CSV file with the columns case, operation, pre, post (docs/outcome.md, "A cohort"). out: a new folder, or that of an earlier
    run. jobs: patients at a time (0: as processors and memory allow). The others: see outcome.

    Returns cohort.json (docs/cohort.schema.json); patients that could not be compared are in its "failed", each with the reason. Errors:
    NotFound (no such program), InvalidInput (the list is wrong, or the folder is not a cohort's).
    """
    words: List[PathLike] = ["cohort", patients, "--out", out, "--jobs", str(jobs)]
    words += _flags(models=models, calibrate=calibrate, accept_findings=accept_findings, pictures=pictures)
    report = pathlib.Path(out) / "cohort.json"
    before = report.stat().st_mtime_ns if report.exists() else None
    ended = _run(program, words)
    # The command writes its report, and then fails, where some patients could not be compared.
    is_written = report.exists() and report.stat().st_mtime_ns != before
    if ended.returncode != 0 and not is_written:
        raise InvalidInput(_error_of(ended.stderr))
    return _read(report)
