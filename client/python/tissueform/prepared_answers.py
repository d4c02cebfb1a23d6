# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Prepared answers of a session, evaluated in this process: predictions without a round trip."""

from __future__ import annotations

import hashlib
from typing import Any, Callable, Iterator, Optional, Sequence

import numpy as np
import numpy.typing as npt

from .answer_evaluator import AnswerEvaluator, HandlePose
from .answer_file import MAX_BYTES
from .errors import DataDamaged
from .poses import Pose, Poses, poses_to_proto
from .predictions import Prediction
from .v1 import deform_service_pb2

_AGAIN = "fetch them again"


def read_answers(responses: Iterator[Any]) -> bytes:
    """The bytes of a GetPreparedAnswers call. Errors: DataDamaged (not contiguous, too long, another SHA-256)."""
    header = next(responses).header
    if not 0 <= header.total_bytes <= MAX_BYTES:
        raise DataDamaged(f"the prepared answers have {header.total_bytes} bytes: at most {MAX_BYTES} are read", advice="ask for fewer vertices")
    data = bytearray()
    for response in responses:
        if response.chunk.offset != len(data) or len(data) + len(response.chunk.data) > header.total_bytes:
            raise DataDamaged("the prepared answers have chunks that are not contiguous", advice=_AGAIN)
        data += response.chunk.data
    if hashlib.sha256(data).hexdigest() != header.sha256:
        raise DataDamaged("the prepared answers are incomplete or damaged: their SHA-256 differs", advice=_AGAIN)
    return bytes(data)


class PreparedAnswers:
    """Made by Session.prepared_answers. The answers are those of the session at that time: fetch them again after Session.update.

    vertices: numbers in the mesh of the vertices of the answers, (#V,) int32; None: all, or the skin. size_bytes: of the answers.
    Constant: any number of threads may evaluate.
    """

    def __init__(self, data: bytes, handles: Sequence[str], vertices: Optional[npt.NDArray[np.int32]],
                 ask_server: Callable[[Poses], Prediction]) -> None:
        try:
            self._evaluator = AnswerEvaluator(data)
        except ValueError as error:
            raise DataDamaged(str(error), advice=_AGAIN) from error
        if self._evaluator.file.handles != len(handles):
            raise DataDamaged("the prepared answers belong to a session with other handles", advice=_AGAIN)
        self._handles = list(handles)
        self._ask_server = ask_server
        self.vertices = vertices
        self.size_bytes = len(data)

    def evaluate(self, poses: Poses) -> Optional[Prediction]:
        """The answer, within summary.error_bound_mm (of neo_hookean: error_estimate_mm) of the server's direct one; None if the poses
        are not covered: ask the server. Errors: InvalidInput (poses)."""
        poses_to_proto(poses, self._handles)  # the same checks as for the server
        in_order = [poses.get(name, Pose()) for name in self._handles]
        own = [HandlePose(pose.rotation_vector, pose.pivot_mm, pose.translation_mm, pose.scale) for pose in in_order]
        positions, error = self._evaluator.evaluate(own)
        if positions is None or not self._evaluator.covers(own, error):
            return None
        is_estimate = self._evaluator.is_estimate
        summary = deform_service_pb2.SolveSummary(converged=True, prepared=True, load=1.0, error_bound_mm=0.0 if is_estimate else error,
                                                  error_estimate_mm=error if is_estimate else 0.0)
        positions.flags.writeable = False
        band = self._evaluator.band(own).astype(np.float32)
        return Prediction(positions, summary, self.vertices, None, band if len(band) > 0 else None)

    def predict(self, poses: Poses) -> Prediction:
        """As evaluate; asks the server (Session.predict with the same vertices and model) where the poses are not covered."""
        return self.evaluate(poses) or self._ask_server(poses)
