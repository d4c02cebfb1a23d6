# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Attempts at the servers of a cluster, by a server that plays them: what it says is written in the tests."""

import concurrent.futures
import os
import pathlib
import queue
import tempfile
import unittest

import grpc
import tissueform
from tissueform import Pose, sample_bar
from tissueform.v1 import (deform_service_pb2, deform_service_pb2_grpc, mesh_pb2, mesh_service_pb2, mesh_service_pb2_grpc, server_info_pb2,
                           server_info_pb2_grpc, session_pb2, session_service_pb2, session_service_pb2_grpc)

ID = "0123456789abcdef"
NAME = f"sessions/{ID}"


def field(number, data):
    return bytes([number << 3 | 2, len(data)]) + data


def details(code, message, reason, **metadata):
    """The bytes of a google.rpc.Status."""
    info = field(1, reason.encode()) + field(2, b"tissueform")
    for key, value in metadata.items():
        info += field(3, field(1, key.encode()) + field(2, value.encode()))
    detail = field(1, b"type.googleapis.com/google.rpc.ErrorInfo") + field(2, info)
    return bytes([8, code.value[0]]) + field(2, message.encode()) + field(3, detail)


class Fault(Exception):
    """An error that the server plays."""

    def __init__(self, code, reason="", **metadata):
        super().__init__(reason)
        self.code, self.reason, self.metadata = code, reason, metadata


class Played(session_service_pb2_grpc.SessionServiceServicer, deform_service_pb2_grpc.DeformServiceServicer,
             mesh_service_pb2_grpc.MeshServiceServicer, server_info_pb2_grpc.ServerInfoServiceServicer):
    """Each call takes the next entry of `script`: a Fault, or the name of the node that answers well. `headers`: of each call."""

    def __init__(self):
        self.script, self.headers, self.requests, self.tokens = [], [], [], queue.Queue()

    def play(self, request, context):
        self.headers.append(dict(context.invocation_metadata()))
        self.requests.append(request)
        step = self.script.pop(0) if self.script else ""
        if isinstance(step, Fault):
            if step.reason:
                context.set_trailing_metadata([("grpc-status-details-bin", details(step.code, "said", step.reason, **step.metadata))])
            context.abort(step.code, "said")
        if step:
            context.send_initial_metadata([("x-tissueform-node", step)])

    def GetServerInfo(self, request, context):
        return server_info_pb2.ServerInfo(version="0")

    def GetSession(self, request, context):
        self.play(request, context)
        return session_pb2.Session(name=request.name, handles=["end"])

    def PrepareSession(self, request, context):
        self.play(request, context)
        yield session_service_pb2.PrepareSessionResponse(session=session_pb2.Session(name=NAME, handles=["end"]))

    def DeleteSession(self, request, context):
        from google.protobuf import empty_pb2
        self.play(request, context)
        return empty_pb2.Empty()

    def GetMesh(self, request, context):
        context.abort(grpc.StatusCode.NOT_FOUND, "no such mesh")

    def QueryUpload(self, request, context):
        return mesh_service_pb2.QueryUploadResponse(committed_bytes=self.committed, total_bytes=self.total)

    def UploadMesh(self, requests, context):
        header = next(requests).header
        self.committed, self.total = getattr(self, "committed", 0), header.total_bytes
        for request in requests:
            if request.chunk.write_offset != self.committed:
                context.abort(grpc.StatusCode.INVALID_ARGUMENT, "a gap")
            self.committed += len(request.chunk.data)
            self.chunks.append(request.chunk.write_offset)
            if self.script and not request.chunk.finish_write:
                self.play(request, context)
        return mesh_service_pb2.UploadMeshResponse(mesh=mesh_pb2.Mesh(name=f"meshes/{header.sha256}"))

    def Deform(self, requests, context):
        self.play(next(requests), context)
        yield deform_service_pb2.DeformResponse(started=deform_service_pb2.DeformStarted(vertex_count=1))
        for request in requests:
            if request.token:
                self.tokens.put(request.token)
            if request.HasField("pose"):
                self.play(request, context)
                yield deform_service_pb2.DeformResponse(frame=deform_service_pb2.DeformFrame(sequence=request.pose.sequence, positions=bytes(12)))
                if request.pose.commit:
                    committed = deform_service_pb2.CommittedNotice(sequence=request.pose.sequence, failure="the disk is full")
                    yield deform_service_pb2.DeformResponse(notice=deform_service_pb2.DeformNotice(committed=committed))


LOST = grpc.StatusCode.UNAVAILABLE


class ClusterTest(unittest.TestCase):
    def setUp(self):
        self.played = Played()
        self.server = grpc.server(concurrent.futures.ThreadPoolExecutor(4))
        for add in (session_service_pb2_grpc.add_SessionServiceServicer_to_server, deform_service_pb2_grpc.add_DeformServiceServicer_to_server,
                    mesh_service_pb2_grpc.add_MeshServiceServicer_to_server, server_info_pb2_grpc.add_ServerInfoServiceServicer_to_server):
            add(self.played, self.server)
        port = self.server.add_insecure_port("127.0.0.1:0")
        self.server.start()
        self.addCleanup(self.server.stop, None)
        self.address = f"127.0.0.1:{port}"
        self.client = tissueform.connect(self.address)
        self.addCleanup(self.client.close)

    def nodes(self):
        """Which node each call named."""
        return [headers.get("x-tissueform-node", "") for headers in self.played.headers]

    def test_a_call_goes_where_the_session_answered_last(self):
        self.played.script = ["a"]
        self.client.session(NAME)
        self.client.session(NAME)
        self.assertEqual(self.nodes(), ["", "a"])
        self.assertEqual({headers["x-tissueform-session"] for headers in self.played.headers}, {ID})

    def test_a_session_that_has_moved_is_followed_at_once(self):
        self.played.script = ["a", Fault(LOST, "SESSION_MOVED", node="b"), "b"]
        self.client.session(NAME)
        self.client.session(NAME)
        self.assertEqual(self.nodes(), ["", "a", "b"])

    def test_a_session_goes_to_the_server_that_has_room(self):
        self.played.script = ["a", Fault(grpc.StatusCode.RESOURCE_EXHAUSTED, "MEMORY_BUDGET_FULL", node="b"), "b"]
        self.client.session(NAME)
        self.client.create_session(tissueform.Mesh("meshes/" + "0" * 64, 4, 1), handles={"end": [0]}, stiffness=1.0)
        self.assertEqual(self.nodes(), ["", "", "b"])

    def test_a_server_that_is_full_and_names_no_other_is_an_error(self):
        self.played.script = ["a", Fault(grpc.StatusCode.RESOURCE_EXHAUSTED, "MEMORY_BUDGET_FULL", node="not a node")]
        self.client.session(NAME)
        with self.assertRaises(tissueform.LimitExceeded):
            self.client.session(NAME)

    def test_a_lost_call_is_repeated_in_a_cluster_only(self):
        self.played.script = [Fault(LOST), "a", Fault(LOST), "b"]
        with self.assertRaises(tissueform.ServerUnavailable):
            self.client.session(NAME)
        self.client.session(NAME)
        self.client.session(NAME)
        self.assertEqual(self.nodes(), ["", "", "a", ""])

    def test_a_creation_is_repeated_with_its_request_id(self):
        self.played.script = ["a", Fault(LOST), "b"]
        self.client.session(NAME)
        mesh = tissueform.Mesh("meshes/" + "0" * 64, 4, 1)
        self.client.create_session(mesh, handles={"end": [0]}, stiffness=1.0)
        ids = [request.create.request_id for request in self.played.requests[1:]]
        self.assertEqual(len(ids), 2)
        self.assertEqual(ids[0], ids[1])
        self.assertEqual(len(ids[0]), 32)

    def test_an_update_that_may_have_been_done_is_not_repeated(self):
        self.played.script = ["a", Fault(LOST), "b"]
        session = self.client.session(NAME)
        with self.assertRaises(tissueform.ServerUnavailable):
            session.update(stiffness=2.0)

    def test_not_found_after_a_lost_deletion_means_deleted(self):
        self.played.script = ["a", Fault(LOST), Fault(grpc.StatusCode.NOT_FOUND, "SESSION_NOT_FOUND")]
        self.client.session(NAME).delete()
        self.played.script = [Fault(grpc.StatusCode.NOT_FOUND, "SESSION_NOT_FOUND")]
        with self.assertRaises(tissueform.NotFound):
            self.client.session(NAME)

    def test_a_drag_follows_its_session(self):
        self.played.script = ["a", "a", "", Fault(LOST, "SESSION_MOVED", node="b"), "b"]
        with self.client.session(NAME).drag() as drag:
            self.assertEqual(drag.move({"end": Pose()}).sequence, 1)
            self.assertEqual(drag.move({"end": Pose()}).sequence, 2)
        self.assertEqual(drag.reattachments, 1)
        self.assertEqual(self.nodes()[:2], ["", "a"])

    def test_a_renewed_token_reaches_an_open_drag_and_the_next_calls(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "token"
            file.touch(mode=0o600)
            file.write_text("first\n")
            with tissueform.connect(self.address, token_file=file) as client, client.session(NAME).drag() as drag:
                drag.move({"end": Pose()})
                file.write_text("second")
                os.utime(file, (1, 1))  # another time, however fast this is
                self.assertEqual(self.played.tokens.get(timeout=10), "second")
                file.write_text("not a token")
                client.session(NAME)
        sent = [headers["authorization"] for headers in self.played.headers]
        self.assertEqual((sent[0], sent[-1]), ("Bearer first", "Bearer second"))

    def test_an_error_that_is_not_lost_ends_the_drag(self):
        self.played.script = ["", "", Fault(grpc.StatusCode.ABORTED, "SESSION_UPDATED")]
        with self.client.session(NAME).drag() as drag, self.assertRaises(tissueform.Conflict) as caught:
            drag.move({"end": Pose()})
        self.assertEqual(caught.exception.reason, "SESSION_UPDATED")

    def test_a_commit_that_fails_is_an_error_at_the_end_of_the_block(self):
        with self.assertRaisesRegex(tissueform.ServerError, "not committed: the disk is full"):
            with self.client.session(NAME).drag() as drag:
                drag.move({"end": Pose()}, commit=True)

    def test_an_error_of_the_progress_function_ends_the_upload(self):
        self.played.chunks, self.played.committed, self.played.total = [], 0, 0

        def report(done, total):
            raise ZeroDivisionError
        with self.assertLogs("grpc", "ERROR"), self.assertRaises(ZeroDivisionError):
            self.client.upload_mesh(*sample_bar((20, 20, 20)), on_progress=report)

    def test_an_interrupted_upload_continues_where_it_was(self):
        self.played.chunks, self.played.committed, self.played.total = [], 0, 0
        self.played.script = [Fault(LOST)]
        progress = []
        points, tets = sample_bar((20, 20, 20))
        self.client.upload_mesh(points, tets, on_progress=lambda done, total: progress.append((done, total)))
        self.assertEqual(self.played.chunks, sorted(set(self.played.chunks)))
        self.assertGreater(len(self.played.chunks), 1)
        self.assertEqual(progress[-1][0], progress[-1][1])

    def test_a_code_of_a_proxy_gives_way_to_the_server_s_own(self):
        fault = Fault(grpc.StatusCode.NOT_FOUND, "SESSION_NOT_FOUND")
        self.played.script = [fault]
        real, fault.code = fault.code, LOST
        self.played.play = lambda request, context: (
            context.set_trailing_metadata([("grpc-status-details-bin", details(real, "gone", "SESSION_NOT_FOUND"))]), context.abort(LOST, "reset"))
        with self.assertRaisesRegex(tissueform.NotFound, "gone"):
            self.client.session(NAME)


if __name__ == "__main__":
    unittest.main()
