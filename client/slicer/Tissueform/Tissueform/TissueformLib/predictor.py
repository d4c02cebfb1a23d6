# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Predictions of a plan's face by a server, for the transforms of a scene."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any, Callable, Dict, Mapping, Optional, Sequence

import numpy as np
import numpy.typing as npt
import tissueform
from tissueform import Client, LocalServer, Plan, Pose, Prediction, TissueformError

from .errors import SceneError
from .face import Face, Points
from .movements import Bone, pose_of

Poses = Mapping[str, Pose]


@dataclasses.dataclass(frozen=True)
class FaceFrame:
    """points: (#V, 3) in RAS. maps: see Face.maps. note: one line for the user; empty where the answer is as good as it gets."""

    points: Points
    maps: Dict[str, npt.NDArray[np.float32]]
    note: str


class Server:
    """A server: the one of an address, or one of its own that ends with close."""

    def __init__(self, address: str, *, program: Optional[pathlib.Path] = None, environment: Optional[Mapping[str, str]] = None,
                 token_file: str = "", tls: bool = False) -> None:
        """address: "HOST:PORT"; empty: start tissueform-server, from the folder of `program` or PATH, with these variables of the
        environment. Raises TissueformError."""
        self._local: Optional[LocalServer] = None
        if not address:
            beside = program.parent / "tissueform-server" if program is not None else None
            self._local = tissueform.local(beside if beside is not None and beside.is_file() else None, environment=environment)
            address = self._local.address
        try:
            self.client: Client = tissueform.connect(address, token_file=token_file or None, tls=tls)
        except BaseException:
            self._end_local()
            raise

    def _end_local(self) -> None:
        if self._local is not None:
            self._local.close()

    def close(self) -> None:
        self.client.close()
        self._end_local()


class FacePredictor:
    """A session of a plan with prepared answers, which are evaluated here: a frame takes a millisecond and no thread."""

    def __init__(self, server: Server, plan: Plan, *, model: str = "") -> None:
        """Takes seconds: the server prepares the session. model: the plan's own if empty. Raises TissueformError."""
        self.plan = plan
        self.face = Face(plan)
        self._session = plan.create_session(server.client, model=model or None)
        self._answer: Callable[[Poses], Prediction] = self._ask_server
        try:
            self._answer = self._session.prepared_answers(vertices=self.face.vertices).predict
        except TissueformError as error:
            if error.reason != "NO_PREPARED_ANSWERS":  # arap: each answer is a round trip
                self._session.delete()
                raise

    def _ask_server(self, poses: Poses) -> Prediction:
        return self._session.predict(poses, vertices=self.face.vertices)

    def poses_of(self, bones: Sequence[Bone]) -> Dict[str, Pose]:
        """Raises SceneError: a bone that the plan does not move, or a transform that is not rigid."""
        for bone in bones:
            if bone.name not in self.plan.handles:
                raise SceneError(f"the plan has no segment {bone.name}: it moves {', '.join(self.plan.handles)}; build it again")
        return {bone.name: pose_of(bone, in_lps=self.plan.coordinate_system == "LPS") for bone in bones}

    def predict(self, bones: Sequence[Bone]) -> FaceFrame:
        """The face for these transforms. Raises SceneError, TissueformError."""
        prediction = self._answer(self.poses_of(bones))
        points = self.face.to_scene(prediction.positions)
        return FaceFrame(points, self.face.maps(points), _note_on(prediction.summary))

    def close(self) -> None:
        """Deletes the session on the server."""
        self._session.delete()


def _note_on(summary: Any) -> str:
    if summary.converged:
        return ""
    reason = f": {summary.obstacle}" if summary.obstacle else ""
    return f"the prediction has not converged{reason}; move the bone less far"
