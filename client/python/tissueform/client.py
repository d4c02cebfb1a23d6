# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A connection to a tissueform-server."""

from __future__ import annotations

import dataclasses
import time
from typing import Any, Callable, Dict, Iterator, Mapping, Optional, Sequence, Tuple, Union

import grpc
import numpy.typing as npt

from ._calls import Backoff, Caller
from ._channel import PathLike, Tls, Token, open_channel
from .errors import WHERE_IS_IT, DeadlineExceeded, ServerUnavailable, error_of_call
from ._uploads import Progress
from .meshes import Mesh, MeshCalls, mesh_of, upload
from .plan_builds import BuiltPlan, PlanBuildCalls, RecipeLike, VolumeLike
from .sessions import ContactRow, LipEdge, Session, StageProgress, Stiffness, create_session
from .stored_predictions import ExportCalls, PredictionCalls, StoredPrediction
from .v1 import server_info_pb2, server_info_pb2_grpc, session_service_pb2, session_service_pb2_grpc


@dataclasses.dataclass(frozen=True)
class ServerInfo:
    """version, commit: of the server. api_version: "tissueform.v1". limits: by name, with the unit at the end of the name.
    models: names. draining: the server takes no new work."""

    version: str
    commit: str
    api_version: str
    limits: Dict[str, int]
    models: Tuple[str, ...]
    draining: bool


class Client:
    """Made by connect. Thread-safe; use it in a `with` block, or call close.

    Calls block for at most call_timeout seconds and raise errors of tissueform.errors. In a cluster, calls go to the server that has the
    session, and are tried again for 30 s where that is safe.
    """

    def __init__(self, address: str, caller: Caller) -> None:
        self.address = address
        self._caller = caller
        self._meshes = MeshCalls(caller)
        self._predictions = PredictionCalls(caller)
        self.exports = ExportCalls(caller)
        self._plan_builds = PlanBuildCalls(caller)
        self._sessions = caller.stub(session_service_pb2_grpc.SessionServiceStub)
        self._info = caller.stub(server_info_pb2_grpc.ServerInfoServiceStub)

    def __repr__(self) -> str:
        return f"Client({self.address!r})"

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection and its drags. Sessions stay on the server."""
        self._caller.channel.close()

    def info(self) -> ServerInfo:
        """What the server is and takes."""
        info = self._caller.unary(self._info.GetServerInfo, server_info_pb2.GetServerInfoRequest())
        return ServerInfo(info.version, info.commit, info.api_version, {limit.name: limit.value for limit in info.limits},
                          tuple(model.name for model in info.models), info.draining)

    # Meshes.

    def upload_mesh(self, points: npt.ArrayLike, tets: npt.ArrayLike, stiffness: Union[None, float, npt.ArrayLike] = None, *,
                    cell_arrays: Optional[Mapping[str, npt.ArrayLike]] = None, any_size: bool = False,
                    on_progress: Optional[Progress] = None) -> Mesh:
        """Uploads a mesh unless the server has it; an interrupted upload continues.

        points: (#V, 3) in mm, in LPS if results go to other programs (ras_to_lps converts). tets: (#T, 4) integers from 0, positively
        oriented: det(b - a, c - a, d - a) > 0. stiffness: Young's modulus in Pa, one number or (#T,). cell_arrays: more values per tet by
        name, (#T,). any_size: allow meshes smaller than 2 mm or larger than 10 m. on_progress: called with bytes sent and bytes in all.
        Arrays may have any number type and layout.

        Errors: InvalidInput (shape, NaN, indices, inverted or flat tets, units), LimitExceeded, Conflict, ServerUnavailable.
        """
        return upload(self._meshes, points, tets, stiffness, cell_arrays, any_size, on_progress)

    def mesh(self, name: str) -> Mesh:
        """Errors: NotFound."""
        return mesh_of(self._meshes.get(name))

    def meshes(self) -> Iterator[Mesh]:
        """Those that the caller may read, in the order of their names."""
        return (mesh_of(message) for message in self._meshes.list())

    def delete_mesh(self, mesh: Mesh) -> None:
        """Errors: NotFound, Conflict (MESH_IN_USE: delete its sessions first)."""
        self._meshes.delete(mesh.name)

    # Sessions.

    def create_session(self, mesh: Mesh, *, handles: Mapping[str, Any], fixed: Any = (), stiffness: Optional[Stiffness] = None,
                       model: str = "gradient_field", poisson_ratio: Optional[float] = None, contact: Sequence[ContactRow] = (),
                       lip_edge: Optional[LipEdge] = None, project: str = "", on_progress: Optional[StageProgress] = None) -> Session:
        """Prepares a session: regions are fixed, the matrix is factorized. Takes seconds for 100,000 vertices. Ctrl-C leaves nothing behind.

        handles: vertices that move together, by name; fixed: vertices that stay; each as numbers from 0, (#,), or as a mask, (#V,) bool.
        stiffness: in Pa, or the name of a cell array; the mesh's own if None. model: "gradient_field", "arap", "linear_elastic" or
        "neo_hookean". poisson_ratio: 0 to below 0.5, of the elastic models. contact: rows by which tissue slides and lifts off (elastic
        models). lip_edge: lips that stay closed, with contact only. project: whoever the caller shares the project with may use the session.
        on_progress: called with stage, step and steps.

        Errors: InvalidInput, NotFound (the mesh), LimitExceeded (memory, sessions), Conflict (NOT_POSITIVE_DEFINITE), ServerUnavailable.
        """
        return create_session(self._caller, mesh, handles, fixed, stiffness, model, poisson_ratio, contact, lip_edge, project, on_progress)

    def session(self, name: str) -> Session:
        """Errors: NotFound."""
        message = self._caller.unary(self._sessions.GetSession, session_service_pb2.GetSessionRequest(name=name), name)
        return Session(self._caller, message)

    def sessions(self) -> Iterator[Session]:
        """The caller's sessions, in memory or stored, in the order of their names."""
        pages = self._caller.pages(self._sessions.ListSessions, session_service_pb2.ListSessionsRequest(), "sessions")
        return (Session(self._caller, message) for message in pages)

    # Plans.

    def build_plan(self, ct: VolumeLike, recipe: RecipeLike, *, labels: Optional[VolumeLike] = None,
                   files: Optional[Mapping[str, Union[PathLike, bytes]]] = None, title: str = "", project: str = "",
                   on_progress: Optional[Callable[[str, float], None]] = None) -> BuiltPlan:
        """Lets the server build a plan and its case from a CT, as `tissueform plan build` does; takes half a minute for a head. Ctrl-C ends
        the build on the server.

        ct: a Volume of Hounsfield units, or the path of a .nrrd, .nii, .nii.gz or .mha file. Geometry and values are sent, and no text of
        the file. A DICOM folder is read by from_dicom. recipe: a dict or the path of a file (docs/recipe-format.md).
        labels: a label map of the CT, as ct. files: those that the recipe names, by their names in it; a recipe that is a file finds them
        next to itself. They and the recipe are sent as they are. title, project: of the case. on_progress: called with what is being done
        and the share of the whole, 0 to 1.

        Errors: InvalidInput (a file, a volume, the recipe), NotFound (a file), Conflict (the build failed: the message says why),
        LimitExceeded (a quota, the queue), Cancelled (ended on the server), ServerError (NOT_IMPLEMENTED: an older server).
        """
        return self._plan_builds.build(ct, recipe, labels, files, title, project, on_progress)

    def build_plan_from_surfaces(self, surfaces: RecipeLike, *, files: Optional[Mapping[str, Union[PathLike, bytes]]] = None, title: str = "",
                                 project: str = "", on_progress: Optional[Callable[[str, float], None]] = None) -> BuiltPlan:
        """Lets the server build a plan and its case without a CT, from skin and bones, as `tissueform plan build --surfaces` does.

        surfaces: a dict or the path of a surfaces file (docs/bring-your-own.md); it states units and axes. files: the surfaces that it names,
        by their names in it; a surfaces file finds them next to itself. All are sent as they are: they must not name the patient. title,
        project, on_progress, errors: as of build_plan.
        """
        return self._plan_builds.build_from_surfaces(surfaces, files, title, project, on_progress)

    # Stored predictions.

    def prediction(self, name: str) -> StoredPrediction:
        """Errors: NotFound, DataDamaged."""
        return self._predictions.get(name)

    def predictions(self, session: Optional[Session] = None) -> Iterator[StoredPrediction]:
        """The caller's stored predictions, of one session or of all."""
        return self._predictions.list("" if session is None else session.name)


def connect(address: str, *, token: Optional[str] = None, token_file: Optional[PathLike] = None, tls: Union[None, bool, Tls] = None,
            insecure: bool = False, timeout: float = 5.0, call_timeout: float = 600.0) -> Client:
    """Connects to a server.

    address: "HOST:PORT" or "unix:/PATH". token, or token_file (mode 0600; read again when it is renewed): who the caller is, for servers
    with logins (`tissueform login` writes such a file). tls: True for this machine's certificate authorities, or Tls(ca=...). insecure:
    allow an unencrypted connection to another machine; a token is never sent unencrypted. timeout: seconds in which the server must answer.
    call_timeout: seconds for each call after that.

    Errors: InvalidInput (address, unencrypted connection), NotFound (a file), ServerUnavailable (no answer), Unauthenticated.
    """
    secret = Token(token, token_file)
    client = Client(address, Caller(open_channel(address, secret, tls, insecure), secret, call_timeout))
    try:
        _wait_until_answered(client, timeout)
    except BaseException:
        client.close()
        raise
    return client


def _wait_until_answered(client: Client, timeout: float) -> None:
    give_up, backoff = time.monotonic() + timeout, Backoff()
    while True:
        left = max(give_up - time.monotonic(), 0.001)
        try:
            client._info.GetServerInfo(server_info_pb2.GetServerInfoRequest(), timeout=left, metadata=client._caller.metadata(""))
            return
        except grpc.RpcError as raised:
            error = error_of_call(raised)
        if error.reason == "NOT_IMPLEMENTED":
            return  # an older server has answered
        if not isinstance(error, (ServerUnavailable, DeadlineExceeded)):
            raise error
        wait = backoff.after(error)
        if time.monotonic() + wait > give_up:
            raise ServerUnavailable(f"{client.address} did not answer in {timeout:g} s: {error.message}", advice=WHERE_IS_IT)
        time.sleep(wait)
