# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Sessions: a mesh with its regions, prepared on the server."""

from __future__ import annotations

import dataclasses
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple, Type, Union

from ._calls import Caller, new_id
from .async_drag import AsyncDrag
from .drag import Drag, Notice
from .errors import InvalidInput, NotFound, ServerError, ServerUnavailable, TissueformError
from .fitting import Fit, FitTarget, Freedom, fit_of, fit_request
from .meshes import Mesh, check_stiffness
from .poses import Pose, Poses, Vector, poses_of, poses_to_proto, vector_to_proto
from .predictions import (MODEL_NAMES, MaterialRanges, Prediction, Prepared, Vertices, band_of, indices_of, model_to_proto,
                          positions_of, prepared_to_proto, ranges_to_proto, selection_to_proto)
from .prepared_answers import PreparedAnswers, read_answers
from .stored_predictions import PredictionCalls, StoredPrediction
from .v1 import deform_service_pb2, deform_service_pb2_grpc, plan_service_pb2_grpc, session_pb2, session_service_pb2, session_service_pb2_grpc

FIXED_BONE = True
Stiffness = Union[float, str]
StageProgress = Callable[[str, int, int], None]


@dataclasses.dataclass(frozen=True)
class ContactRow:
    """Where tissue touches bone or tissue. vertex: neither fixed nor in a handle. touches: the name of a handle (bone that moves with it),
    FIXED_BONE, or the number of another free vertex. normal: from what is touched towards the vertex, (3,), length 1. gap_mm: at rest,
    0 or more. bilateral: the vertex slides along the bone and does not leave it; otherwise it lifts off."""

    vertex: int
    touches: Union[str, bool, int]
    normal: Vector
    gap_mm: float = 0.0
    bilateral: bool = False


@dataclasses.dataclass(frozen=True)
class LipEdge:
    """The front edge of two parted lips that touch at rest. up: from the lower lip to the upper one, (3,), length 1. pairs: an upper and a
    lower vertex each, at the same place at rest and with a contact row between them. sealed: the lower edge follows the upper one, until
    they are parted too far; linear_elastic only (docs/lips.md)."""

    up: Vector
    pairs: Sequence[Tuple[int, int]]
    sealed: bool = True


def _lip_edge_to_proto(edge: Optional[LipEdge]) -> Optional[session_pb2.LipEdge]:
    if edge is None:
        return None
    pairs = [session_pb2.LipEdge.Pair(upper=upper, lower=lower) for upper, lower in edge.pairs]
    return session_pb2.LipEdge(up=vector_to_proto(edge.up, "up of the lip edge"), pairs=pairs, sealed=edge.sealed)


def _contact_to_proto(row: ContactRow, index: int) -> session_pb2.ContactRow:
    message = session_pb2.ContactRow(vertex=row.vertex, normal=vector_to_proto(row.normal, f"the normal of contact row {index}"),
                                     gap_mm=row.gap_mm, bilateral=row.bilateral)
    if isinstance(row.touches, str):
        message.handle = row.touches
    elif row.touches is FIXED_BONE:
        message.fixed_bone = True
    else:
        message.other_vertex = int(row.touches)
    return message


def _stiffness_to_proto(stiffness: Optional[Stiffness]) -> session_pb2.Stiffness:
    if stiffness is None:
        raise InvalidInput("the mesh has no stiffness", advice="give stiffness in Pa, or the name of a cell array")
    if isinstance(stiffness, str):
        return session_pb2.Stiffness(cell_array=stiffness)
    return session_pb2.Stiffness(uniform_pa=check_stiffness(float(stiffness)))


def _handles_to_proto(handles: Mapping[str, Any], mesh_vertices: int) -> List[session_pb2.Handle]:
    return [session_pb2.Handle(name=name, vertices=indices_of(vertices, f'the vertices of handle "{name}"', mesh_vertices).tolist())
            for name, vertices in handles.items()]


class Session:
    """A session of a server. It stays there until it is deleted or expires; a `with` block deletes it at its end.

    name: "sessions/{id}". handles: names. description: all that is known (v1.Session: counts, bytes_held, seconds, etag, ...).
    Thread-safe, except update and refresh.
    """

    def __init__(self, caller: Caller, message: session_pb2.Session) -> None:
        self._caller = caller
        self._sessions = caller.stub(session_service_pb2_grpc.SessionServiceStub)
        self._deform = caller.stub(deform_service_pb2_grpc.DeformServiceStub)
        self._plans = caller.stub(plan_service_pb2_grpc.PlanServiceStub)
        self._predictions = PredictionCalls(caller)
        self.description = message
        self.name: str = message.name

    def __repr__(self) -> str:
        return f"Session({self.name!r}, model={self.model!r}, handles={self.handles!r})"

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], *_: object) -> None:
        try:
            self.delete()
        except NotFound:
            return
        except TissueformError:
            if kind is None:  # otherwise the block's own error counts
                raise

    @property
    def handles(self) -> List[str]:
        return list(self.description.handles)

    @property
    def _vertex_count(self) -> int:
        return int(self.description.vertex_count)

    @property
    def model(self) -> str:
        return MODEL_NAMES.get(self.description.model, "unknown")

    @property
    def committed_poses(self) -> Dict[str, Pose]:
        """The poses that were last committed by a drag, as of the last refresh; empty: none."""
        return poses_of(self.description.committed_poses)

    def predict(self, poses: Poses, *, vertices: Vertices = "all", model: Optional[str] = None,
                ranges: Optional[MaterialRanges] = None) -> Prediction:
        """One answer. poses: one for each handle that moves; the others rest. vertices: "all", "skin" (in the order of the server) or
        numbers. model: another than the session's own. The positions are bit by bit those of `tissueform run`. ranges: of
        linear_elastic and neo_hookean, the answer has uncertainty_p95_mm, also with contact; takes seconds in a head.

        Errors: InvalidInput, NotFound (the session has ended), LimitExceeded, ServerUnavailable.
        """
        request = deform_service_pb2.DeformOnceRequest(session=self.name, poses=poses_to_proto(poses, self.handles),
                                                       vertices=selection_to_proto(vertices, self._vertex_count), model=model_to_proto(model),
                                                       ranges=ranges_to_proto(ranges))
        response = self._caller.unary(self._deform.DeformOnce, request, self.name)
        numbers = None if isinstance(vertices, str) else indices_of(vertices, "vertices", self._vertex_count)
        return Prediction(positions_of(response.positions), response.summary, numbers, response.quality,
                          band_of(response.uncertainty_p95_mm), response.no_uncertainty)

    def drag(self, *, vertices: Vertices = "all", model: Optional[str] = None, prepared: Union[bool, Prepared] = False,
             max_unacked: int = 2, reconnect_timeout: float = 60.0, on_notice: Optional[Callable[[Notice], None]] = None) -> Drag:
        """Opens a drag; use it in a `with` block. prepared: frames come from prepared answers, which takes seconds at the beginning.
        max_unacked: frames that may be in transit. reconnect_timeout: seconds for which a lost connection is tried again. on_notice: called
        on the receiving thread with what the server says besides frames (draining, evicted, restored, committed, updated).

        Errors: InvalidInput, NotFound, LimitExceeded (too many drags), ServerUnavailable.
        """
        configuration = deform_service_pb2.DeformConfiguration(
            session=self.name, vertices=selection_to_proto(vertices, self._vertex_count), model=model_to_proto(model), max_unacked=max_unacked,
            prepared=prepared_to_proto(prepared))
        return Drag(self._caller, self.handles, configuration, reconnect_timeout=reconnect_timeout, on_notice=on_notice)

    def async_drag(self, *, vertices: Vertices = "all", model: Optional[str] = None, prepared: Union[bool, Prepared] = False,
                   max_unacked: int = 2, reconnect_timeout: float = 60.0) -> AsyncDrag:
        """The same for asyncio; use it in an `async with` block, which opens it."""
        return AsyncDrag(lambda: self.drag(vertices=vertices, model=model, prepared=prepared, max_unacked=max_unacked,
                                           reconnect_timeout=reconnect_timeout))

    def prepared_answers(self, *, vertices: Vertices = "all", model: Optional[str] = None, prepared: Prepared = Prepared()) -> PreparedAnswers:
        """Fetches the answers that a drag with the same arguments makes its frames from, to evaluate them here.

        Errors: InvalidInput (NO_PREPARED_ANSWERS: arap has none), LimitExceeded (too many bytes: ask for fewer vertices), DataDamaged.
        """
        request = deform_service_pb2.GetPreparedAnswersRequest(session=self.name, vertices=selection_to_proto(vertices, self._vertex_count),
                                                               model=model_to_proto(model), prepared=prepared_to_proto(prepared))
        data = self._caller.stream(self._deform.GetPreparedAnswers, request, read_answers, self.name)
        numbers = None if isinstance(vertices, str) else indices_of(vertices, "vertices", self._vertex_count)
        return PreparedAnswers(data, self.handles, numbers, lambda poses: self.predict(poses, vertices=vertices, model=model))

    def store_prediction(self, poses: Poses, *, model: Optional[str] = None, title: str = "", case: str = "") -> StoredPrediction:
        """Predicts, and stores the answer for all vertices on the server. title: no patient data. case: "cases/{sha256}".

        Errors: those of predict; LimitExceeded (too many predictions, disk full).
        """
        return self._predictions.create(self.name, poses_to_proto(poses, self.handles), model, title, case)

    def fit(self, targets: Sequence[FitTarget], freedoms: Mapping[str, Freedom], *, poses: Optional[Poses] = None, symmetric: bool = False,
            tolerance_mm: float = 0.5, model: Optional[str] = None, verify: bool = False) -> Fit:
        """Poses that give a face that is wanted. freedoms: by handle. poses: where the search begins. symmetric: no handle leaves the
        midsagittal plane (across x). tolerance_mm: a target that is missed by more is not reached. verify: the model itself has the last
        word. A target that cannot be reached is not an error.

        Errors: InvalidInput, NotFound, LimitExceeded.
        """
        start = poses_to_proto(poses, self.handles) if poses is not None else []
        request = fit_request(self.name, self._vertex_count, targets, freedoms, start, symmetric, tolerance_mm, model_to_proto(model), verify)
        return fit_of(self._caller.unary(self._plans.Fit, request, self.name))

    def update(self, *, stiffness: Optional[Stiffness] = None, model: Optional[str] = None, poisson_ratio: Optional[float] = None,
               fixed: Any = None, handles: Optional[Mapping[str, Any]] = None, contact: Sequence[ContactRow] = (),
               lip_edge: Optional[LipEdge] = None, on_progress: Optional[StageProgress] = None) -> None:
        """Prepares the session again with these changes; what is left out stays. fixed, handles, contact and lip_edge replace all regions
        together.

        Errors: those of Client.create_session; Conflict (STALE_ETAG: somebody else has changed it since the last refresh).
        """
        if handles is None and (fixed is not None or contact or lip_edge is not None):
            raise InvalidInput("regions are replaced together", advice="give handles with fixed, contact and lip_edge")
        request = session_service_pb2.UpdateSessionRequest(name=self.name, etag=self.description.etag, model=model_to_proto(model),
                                                           poisson_ratio=poisson_ratio)
        if stiffness is not None:
            request.stiffness.CopyFrom(_stiffness_to_proto(stiffness))
        if handles is not None:
            request.regions.CopyFrom(session_service_pb2.SessionRegions(
                fixed_vertices=indices_of([] if fixed is None else fixed, "fixed vertices", self._vertex_count).tolist(),
                handles=_handles_to_proto(handles, self._vertex_count),
                contact=[_contact_to_proto(row, index) for index, row in enumerate(contact)],
                lip_edge=_lip_edge_to_proto(lip_edge)))
        whole = session_service_pb2.PrepareSessionRequest(update=request)
        self.description = prepare(self._caller, self._sessions, whole, self.name, on_progress, repeat_if_lost=False)

    def refresh(self) -> None:
        """Reads `description` again."""
        self.description = self._caller.unary(self._sessions.GetSession, session_service_pb2.GetSessionRequest(name=self.name), self.name)

    def delete(self) -> None:
        """Its memory is free when this returns. The mesh and stored predictions stay."""
        self._caller.delete(self._sessions.DeleteSession, session_service_pb2.DeleteSessionRequest(name=self.name), self.name)


def prepare(caller: Caller, stub: Any, request: session_service_pb2.PrepareSessionRequest, name: str, on_progress: Optional[StageProgress], *,
            repeat_if_lost: bool) -> session_pb2.Session:
    """The session when it is ready. on_progress: called with the stage's name, step and steps (0, 0 where the stage does not count)."""
    def take(responses: Iterator[Any]) -> session_pb2.Session:
        session: Optional[session_pb2.Session] = None
        for response in responses:
            if response.HasField("session"):
                session = response.session
            elif on_progress is not None:
                stage = session_service_pb2.PreparationStage.Name(response.progress.stage)
                on_progress(stage.replace("PREPARATION_STAGE_", "").lower(), response.progress.step, response.progress.steps)
        if session is None:
            raise ServerUnavailable("the server's answer was lost in transit")
        return session
    return caller.stream(stub.PrepareSession, request, take, name, repeat_if_lost=repeat_if_lost)


def create_session(caller: Caller, mesh: Mesh, handles: Mapping[str, Any], fixed: Any, stiffness: Optional[Stiffness], model: str,
                   poisson_ratio: Optional[float], contact: Sequence[ContactRow], lip_edge: Optional[LipEdge], project: str,
                   on_progress: Optional[StageProgress]) -> Session:
    """See Client.create_session."""
    request = session_service_pb2.CreateSessionRequest(
        mesh=mesh.name, stiffness=_stiffness_to_proto(mesh.stiffness if stiffness is None else stiffness),
        fixed_vertices=indices_of(fixed, "fixed vertices", mesh.vertex_count).tolist(),
        handles=_handles_to_proto(handles, mesh.vertex_count), model=model_to_proto(model),
        poisson_ratio=poisson_ratio, contact=[_contact_to_proto(row, index) for index, row in enumerate(contact)],
        lip_edge=_lip_edge_to_proto(lip_edge), project=project, request_id=new_id())
    stub = caller.stub(session_service_pb2_grpc.SessionServiceStub)
    whole = session_service_pb2.PrepareSessionRequest(create=request)
    try:
        return Session(caller, prepare(caller, stub, whole, "", on_progress, repeat_if_lost=True))
    except ServerError as error:
        if error.reason != "NOT_IMPLEMENTED":
            raise
    return Session(caller, caller.unary(stub.CreateSession, request))  # version 0.1 does not report its stages
