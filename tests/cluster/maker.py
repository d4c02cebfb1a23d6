# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Makes meshes, sessions and predictions in a cluster, deletes some, and reads back what was acknowledged."""

import hashlib
import random
import struct
import threading
import uuid

import drags
import stranger
from send_and_prepare import BOX, box_mesh

LAYER = (BOX[0] + 1) * (BOX[1] + 1)
LINEAR_ELASTIC = 3


class Maker:
    """One client's calls. One thread at a time."""

    def __init__(self, address, ledger, chance):
        self.server = stranger.Stranger(address)
        self.ledger, self.chance = ledger, chance
        self.vertices, self.tets = box_mesh()

    def new_mesh(self):
        """Acknowledged: the name of a mesh like no other, and the rest of its handle's first vertex."""
        from tissueform.v1 import mesh_service_pb2 as protocol
        shift = self.chance.uniform(-1000, 1000)
        vertices = [(x, y, z + shift) for x, y, z in self.vertices]
        payload = b"".join(struct.pack("<3d", *vertex) for vertex in vertices) + b"".join(struct.pack("<4i", *tet) for tet in self.tets)
        text = f"tissueform-mesh 1\nvertices {len(vertices)}\ntets {len(self.tets)}\n".encode()
        header = {"vertex_count": len(vertices), "tet_count": len(self.tets), "total_bytes": len(payload),
                  "sha256": hashlib.sha256(text + payload).hexdigest()}
        mesh = self.server.send("MeshService/UploadMesh", [
            protocol.UploadMeshRequest(header=header),
            protocol.UploadMeshRequest(chunk={"write_offset": 0, "data": payload, "finish_write": True})], protocol.UploadMeshResponse).mesh
        self.ledger.mesh(mesh.name, mesh.vertex_count)
        handle = len(vertices) - LAYER
        return mesh.name, (handle, struct.unpack("<f", struct.pack("<f", vertices[handle][2]))[0])

    def new_session(self, mesh):
        """Acknowledged: its name."""
        from tissueform.v1 import session_pb2, session_service_pb2 as protocol
        name = uuid.UUID(int=self.chance.getrandbits(128)).hex
        request = protocol.CreateSessionRequest(
            mesh=mesh, stiffness={"uniform_pa": 2000.0}, fixed_vertices=range(LAYER), model=LINEAR_ELASTIC, request_id=name, session_id=name,
            handles=[{"name": drags.HANDLE, "vertices": range(len(self.vertices) - LAYER, len(self.vertices))}])
        session = self.server.call("SessionService/CreateSession", request, session_pb2.Session, stranger.Route(name))
        self.ledger.session(session.name, session.mesh, session.etag)
        return session.name

    def delete_session(self, name):
        from google.protobuf import empty_pb2
        from tissueform.v1 import session_service_pb2 as protocol
        self.ledger.going(name)
        tries = []
        try:
            self.server.call("SessionService/DeleteSession", protocol.DeleteSessionRequest(name=name), empty_pb2.Empty,
                             stranger.Route(name.removeprefix("sessions/")), on_retry=lambda: tries.append(1))
        except stranger.Refused as refused:
            if refused.reason != "SESSION_NOT_FOUND" or not tries:  # an attempt whose answer was lost may have done it
                raise
        self.ledger.deleted_session(name)

    def new_prediction(self, session):
        from tissueform.v1 import prediction_pb2, prediction_service_pb2 as protocol
        request = protocol.CreatePredictionRequest(session=session, request_id=uuid.UUID(int=self.chance.getrandbits(128)).hex,
                                                   poses=[{"handle": drags.HANDLE, "translation_mm": {"z": self.chance.uniform(0, 2)}}])
        route = stranger.Route(session.removeprefix("sessions/"))
        made = self.server.call("PredictionService/CreatePrediction", request, prediction_pb2.Prediction, route)
        digest = self.positions_digest(made.name)
        self.ledger.prediction(made.name, session, digest)

    def positions_digest(self, prediction):
        from tissueform.v1 import prediction_service_pb2 as protocol
        chunks = self.server.read("PredictionService/ReadPositions", protocol.ReadPositionsRequest(name=prediction), protocol.ReadPositionsResponse)
        return hashlib.sha256(b"".join(each.chunk.data for each in chunks)).hexdigest()

    def session_state(self, name):
        """The session as any server knows it."""
        from tissueform.v1 import session_pb2, session_service_pb2 as protocol
        return self.server.call("SessionService/GetSession", protocol.GetSessionRequest(name=name), session_pb2.Session, patience_s=30)

    def mesh_state(self, name):
        from tissueform.v1 import mesh_pb2, mesh_service_pb2 as protocol
        return self.server.call("MeshService/GetMesh", protocol.GetMeshRequest(name=name), mesh_pb2.Mesh, patience_s=30)


class Churn(threading.Thread):
    """A client that makes and deletes all the while."""

    def __init__(self, address, ledger, seed):
        super().__init__(daemon=True)
        self.maker = Maker(address, ledger, random.Random(seed))
        self.ledger, self.ending = ledger, threading.Event()

    def stop(self):
        self.ending.set()

    def run(self):
        kept = []
        while not self.ending.is_set():
            try:
                mesh, _ = self.maker.new_mesh()
                session = self.maker.new_session(mesh)
                self.maker.new_prediction(session)
                kept.append(session)
                if len(kept) > 3:
                    self.maker.delete_session(kept.pop(0))
            except stranger.Refused as refused:
                self.ledger.violation(f"a client that makes sessions was refused: {refused}")
            self.ending.wait(0.3)


def read_back(makers, ledger):
    """All that was acknowledged, through one server after the other."""
    def check(what, condition):
        if not condition:
            ledger.violation(what)

    def read(name, ask):
        try:
            return ask(name)
        except stranger.Refused as refused:
            ledger.violation(f"{name} was acknowledged and cannot be read: {refused}")
            return None

    for number, (name, vertices) in enumerate(ledger.meshes.items()):
        mesh = read(name, makers[number % len(makers)].mesh_state)
        check(f"{name} is another mesh now", mesh is None or mesh.vertex_count == vertices)
    for number, (name, (mesh, etag)) in enumerate(ledger.sessions.items()):
        session = read(name, makers[number % len(makers)].session_state)
        check(f"{name} is another session now", session is None or (session.mesh, session.etag) == (mesh, etag))
    for number, name in enumerate(ledger.deleted):
        try:
            makers[number % len(makers)].session_state(name)
            ledger.violation(f"{name} was deleted and is there")
        except stranger.Refused as refused:
            check(f"{name} was deleted: {refused}", refused.reason == "SESSION_NOT_FOUND")
    for number, (name, (_, digest)) in enumerate(ledger.predictions.items()):
        now = read(name, makers[number % len(makers)].positions_digest)
        check(f"{name} has other positions now", now in (None, digest))
    for name, newest in ledger.committed_to.items():
        for maker in makers:
            session = read(name, maker.session_state)
            if session is None:
                continue
            kept = int(session.committed_poses[0].pivot_mm.x) if session.committed_poses else 0
            check(f"{name}: pose {newest} was acknowledged as committed, {kept} is kept", kept >= newest)
            check(f"{name}: pose {kept} is kept, and was never to be committed", kept in ledger.sent[name])
