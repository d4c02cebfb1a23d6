# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Predictions that the server stores, and their way to the PACS."""

from __future__ import annotations

import dataclasses
import datetime
from typing import Any, Dict, Iterator, Optional, Sequence

from ._calls import Caller, new_id
from .errors import DataDamaged
from .poses import Pose, poses_of
from .predictions import MODEL_NAMES, Positions, Vertices, model_to_proto, positions_of, selection_to_proto
from .v1 import export_service_pb2, export_service_pb2_grpc, geometry_pb2, prediction_pb2, prediction_service_pb2, prediction_service_pb2_grpc

_EXPORT_STATES = {1: "waiting", 2: "confirmation", 3: "storing", 4: "stored", 5: "failed"}


@dataclasses.dataclass(frozen=True)
class Measure:
    """A number for the report in the PACS, before and after. name: a-z, 0-9 and _. unit: "mm" or "deg"."""

    name: str
    title: str
    unit: str
    before: float
    after: float


@dataclasses.dataclass(frozen=True)
class Export:
    """A request to store a prediction in the PACS. state: "waiting" (for a bridge), "confirmation" (a person checks the patient),
    "storing", "stored", or "failed"; detail: why, one line. stored_objects: how many the PACS has acknowledged."""

    name: str
    prediction: str
    state: str
    detail: str
    stored_objects: int


def _export_of(message: Any) -> Export:
    return Export(message.name, message.prediction, _EXPORT_STATES.get(message.state, "unknown"), message.detail, message.stored_objects)


class ExportCalls:
    """The export service of one server."""

    def __init__(self, caller: Caller) -> None:
        self._caller = caller
        self._stub = caller.stub(export_service_pb2_grpc.ExportServiceStub)

    def create(self, prediction: str, measures: Sequence[Measure]) -> Export:
        request = export_service_pb2.CreateExportRequest(
            prediction=prediction, measures=[export_service_pb2.Measure(**dataclasses.asdict(measure)) for measure in measures],
            request_id=new_id())
        return _export_of(self._caller.unary(self._stub.CreateExport, request))

    def get(self, name: str) -> Export:
        return _export_of(self._caller.unary(self._stub.GetExport, export_service_pb2.GetExportRequest(name=name)))

    def list(self, prediction: str = "") -> Iterator[Export]:
        request = export_service_pb2.ListExportsRequest(prediction=prediction)
        return (_export_of(message) for message in self._caller.pages(self._stub.ListExports, request, "exports"))

    def delete(self, name: str) -> None:
        self._caller.delete(self._stub.DeleteExport, export_service_pb2.DeleteExportRequest(name=name))


class StoredPrediction:
    """An answer that the server keeps with its request. It never changes, and outlives its session and mesh.

    description: all that is known (v1.Prediction). name: "predictions/{id}". poses: by handle. model. title.
    """

    def __init__(self, caller: Caller, message: prediction_pb2.Prediction) -> None:
        self._caller = caller
        self._stub = caller.stub(prediction_service_pb2_grpc.PredictionServiceStub)
        self._exports = ExportCalls(caller)
        self.description = message
        self.name: str = message.name
        self.title: str = message.title
        self.model: str = MODEL_NAMES.get(message.model, "unknown")
        self.poses: Dict[str, Pose] = poses_of(message.poses)
        self.create_time: datetime.datetime = message.create_time.ToDatetime(datetime.timezone.utc)

    def __repr__(self) -> str:
        return f"StoredPrediction({self.name!r}, model={self.model!r})"

    def positions(self) -> Positions:
        """Of all vertices of the mesh in mm, (#V, 3) float32, read-only. Errors: NotFound, DataDamaged."""
        def take(responses: Iterator[Any]) -> bytes:
            data = bytearray()
            for response in responses:
                if response.chunk.offset != len(data):
                    raise DataDamaged("the positions came with a gap", advice="read them again")
                data += response.chunk.data
            if len(data) != 12 * self.description.vertex_count:
                raise DataDamaged("the positions are not complete", advice="read them again")
            return bytes(data)
        request = prediction_service_pb2.ReadPositionsRequest(name=self.name)
        return positions_of(self._caller.stream(self._stub.ReadPositions, request, take))

    def compare(self, other: Optional["StoredPrediction"] = None, *, model: Optional[str] = None,
                vertices: Vertices = "all") -> prediction_pb2.PredictionComparison:
        """Distances to another prediction of the same mesh, or to what another model answers to the same poses
        (v1.PredictionComparison: distances.mean_mm, p95_mm, max_mm, ...). Errors: Conflict (NOT_COMPARABLE), NotFound, InvalidInput."""
        selection = selection_to_proto(vertices, self.description.vertex_count)
        request = prediction_service_pb2.ComparePredictionsRequest(prediction=self.name, vertices=selection)
        if other is not None:
            request.other_prediction = other.name
        else:
            request.other_model = model_to_proto(model)

        def take(responses: Iterator[Any]) -> prediction_pb2.PredictionComparison:
            comparison: prediction_pb2.PredictionComparison = next(responses).comparison
            return comparison
        return self._caller.stream(self._stub.ComparePredictions, request, take)

    def export(self, measures: Sequence[Measure] = ()) -> Export:
        """Requests that a bridge stores it in the study of its case. See Client.exports for how it goes on.
        Errors: Conflict (the prediction has no case), LimitExceeded."""
        return self._exports.create(self.name, measures)

    def delete(self) -> None:
        """Nothing of it is left in the server's store when this returns. Errors: NotFound."""
        self._caller.delete(self._stub.DeletePrediction, prediction_service_pb2.DeletePredictionRequest(name=self.name))


class PredictionCalls:
    """The prediction service of one server."""

    def __init__(self, caller: Caller) -> None:
        self._caller = caller
        self._stub = caller.stub(prediction_service_pb2_grpc.PredictionServiceStub)

    def create(self, session: str, poses: Sequence[geometry_pb2.HandlePose], model: Optional[str], title: str, case: str) -> StoredPrediction:
        request = prediction_service_pb2.CreatePredictionRequest(session=session, poses=poses, model=model_to_proto(model), title=title,
                                                                 case=case, request_id=new_id())
        return StoredPrediction(self._caller, self._caller.unary(self._stub.CreatePrediction, request, session))

    def get(self, name: str) -> StoredPrediction:
        return StoredPrediction(self._caller, self._caller.unary(self._stub.GetPrediction, prediction_service_pb2.GetPredictionRequest(name=name)))

    def list(self, session: str) -> Iterator[StoredPrediction]:
        request = prediction_service_pb2.ListPredictionsRequest(session=session)
        return (StoredPrediction(self._caller, message) for message in self._caller.pages(self._stub.ListPredictions, request, "predictions"))
