# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A client of a cluster by python3-grpcio and docs/service-api.md, as somebody would write one: it sends a session's id and
the node that has answered it last, follows SESSION_MOVED, and asks again where the cluster says that it may."""

import importlib
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

import grpc

GOOGLE_PROTOS = pathlib.Path("/usr/share/gocode/src/github.com/gogo/googleapis")
SESSION_HEADER, NODE_HEADER = "x-tissueform-session", "x-tissueform-node"
MOST_HOPS = 4
FIRST_WAIT_S, MOST_WAIT_S = 0.05, 0.4
LASTING_S = 2  # what ends sooner after an answer has come to nothing: a server may let streams begin and end them at once
ATTEMPT_S = 15
ELSEWHERE = {"SESSION_MOVED", "MEMORY_BUDGET_FULL"}
# With any code: through HAProxy an error that ends a stream early may arrive as CANCELLED, with the server's details.
LATER = ELSEWHERE | {"WRONG_NODE", "SERVER_DRAINING", "UNAVAILABLE", "SESSION_BEING_DELETED"}
# What a proxy or a cut connection says where a server has said nothing.
FROM_THE_WAY = {grpc.StatusCode.UNKNOWN, grpc.StatusCode.INTERNAL, grpc.StatusCode.CANCELLED, grpc.StatusCode.DEADLINE_EXCEEDED}
CHANNEL = [("grpc.initial_reconnect_backoff_ms", 50), ("grpc.min_reconnect_backoff_ms", 50), ("grpc.max_reconnect_backoff_ms", 200),
           ("grpc.use_local_subchannel_pool", 1), ("grpc.enable_retries", 0), ("grpc.max_receive_message_length", 64 << 20)]


def import_protocol(folder_of_protos):
    """What protoc makes of the protocol, in the versions of this machine."""
    folder = tempfile.mkdtemp()
    ours = sorted(str(path) for path in pathlib.Path(folder_of_protos).glob("tissueform/v1/*.proto"))
    google = ["google/rpc/status.proto", "google/rpc/error_details.proto"]
    subprocess.run(["protoc", f"--proto_path={folder_of_protos}", f"--python_out={folder}", *ours], check=True)
    subprocess.run(["protoc", f"--proto_path={GOOGLE_PROTOS}", f"--python_out={folder}", *google], check=True)
    sys.path.insert(0, folder)
    # Beside the package of the same name that protobuf has.
    import google as package
    package.__path__.append(f"{folder}/google")
    for path in (*pathlib.Path(folder).glob("tissueform/v1/*.py"), *pathlib.Path(folder).glob("google/rpc/*.py")):
        importlib.import_module(".".join(path.relative_to(folder).with_suffix("").parts))
    shutil.rmtree(folder)


def why(error):
    """(code, reason, metadata) of an error by its google.rpc.ErrorInfo; no reason where there is none."""
    from google.rpc import error_details_pb2, status_pb2
    details = dict(error.trailing_metadata() or ()).get("grpc-status-details-bin", b"")
    info = error_details_pb2.ErrorInfo()
    for detail in status_pb2.Status.FromString(details).details:
        if detail.Unpack(info):
            return error.code(), info.reason, dict(info.metadata)
    return error.code(), "", {}


class Refused(Exception):
    """With code and reason: asking again does not help, or has not helped for as long as one was ready to wait."""

    def __init__(self, code, reason, text):
        super().__init__(f"{code.name} {reason} {text}")
        self.code, self.reason = code, reason


class Route:
    """Where one session's calls go. One thread at a time."""

    def __init__(self, session):
        self.session = session  # its id; "": a call of none
        self.node = None
        self.hops = 0
        self.wait_s = FIRST_WAIT_S
        self.may_be_at_once = True
        self.answered_at = None  # the first time since the last failure

    def metadata(self):
        headers = [(SESSION_HEADER, self.session)] if self.session else []
        return headers + ([(NODE_HEADER, self.node)] if self.node else [])

    def answered(self, initial_metadata):
        self.node = dict(initial_metadata or ()).get(NODE_HEADER, self.node) if self.session else None
        self.answered_at = self.answered_at or time.monotonic()

    def failed(self, error):
        """Seconds until it may be tried again; Refused where that is no use."""
        code, reason, metadata = why(error)
        if self.answered_at is not None and time.monotonic() - self.answered_at >= LASTING_S:
            self.hops, self.wait_s, self.may_be_at_once = 0, FIRST_WAIT_S, True
        self.answered_at = None
        node = metadata.get("node")
        if reason in ELSEWHERE and node and self.hops < MOST_HOPS:
            self.node, self.hops = node, self.hops + 1
            return 0.0
        if reason not in LATER and not (code == grpc.StatusCode.UNAVAILABLE or (not reason and code in FROM_THE_WAY)):
            raise Refused(code, reason, error.details())
        self.node, self.hops = None, 0
        if reason == "SESSION_MOVED" and self.may_be_at_once:
            self.may_be_at_once = False
            return 0.0
        wait_s, self.wait_s = self.wait_s, min(MOST_WAIT_S, self.wait_s * 1.6)
        return wait_s * random.uniform(0.8, 1.2)


class Stranger:
    """One connection to the cluster, or to one of its servers. Any thread."""

    def __init__(self, address):
        self.channel = grpc.insecure_channel(address, options=CHANNEL)

    def close(self):
        self.channel.close()

    def method(self, name, answer, arity="unary_unary"):
        return getattr(self.channel, arity)(f"/tissueform.v1.{name}", request_serializer=lambda message: message.SerializeToString(),
                                            response_deserializer=answer.FromString)

    def call(self, name, request, answer, route=None, patience_s=90, on_retry=None):
        """The answer to a call that may be repeated, tried until it comes."""
        return self._until_answered(lambda metadata: self.method(name, answer).with_call(request, metadata=metadata, timeout=ATTEMPT_S),
                                    route, patience_s, on_retry)

    def send(self, name, requests, answer, route=None, patience_s=90):
        """The same for a call with a stream of requests, a list."""
        def attempt(metadata):
            return self.method(name, answer, "stream_unary").with_call(iter(requests), metadata=metadata, timeout=ATTEMPT_S)
        return self._until_answered(attempt, route, patience_s, None)

    def read(self, name, request, answer, route=None, patience_s=90):
        """All answers of a stream."""
        def attempt(metadata):
            call = self.method(name, answer, "unary_stream")(request, metadata=metadata, timeout=ATTEMPT_S)
            return list(call), call
        return self._until_answered(attempt, route, patience_s, None)

    @staticmethod
    def _until_answered(attempt, route, patience_s, on_retry):
        route = route or Route("")
        end = time.monotonic() + patience_s
        while True:
            try:
                reply, call = attempt(route.metadata())
                route.answered(call.initial_metadata())
                return reply
            except grpc.RpcError as error:
                wait_s = route.failed(error)
                if time.monotonic() > end:
                    raise Refused(*why(error)[:2], f"for {patience_s} s: {error.details()}") from None
                if on_retry is not None:
                    on_retry()
            time.sleep(wait_s)
