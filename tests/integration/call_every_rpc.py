#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Calls every rpc of a server with an empty message, by python3-grpcio and what the server's reflection says.

  call_every_rpc.py HOST:PORT FOLDER_OF_GRPC_PROTOS FOLDER_OF_GOOGLE_RPC_PROTOS

Prints a line "package.Service/Method CODE REASON" for each; the reason is that of google.rpc.ErrorInfo, as any client
would find it. Exit code 1 when a service has no schema or an error no reason; 77 when a Python module is missing.
"""

import subprocess
import sys
import tempfile

try:
    import grpc
    from google.protobuf import descriptor_pb2, descriptor_pool
except ImportError as missing:
    print(missing)
    sys.exit(77)

PATIENCE_S = 30


def import_messages(folders_and_files):
    """What protoc makes of the files, in the versions of this machine."""
    folder = tempfile.mkdtemp()
    for proto_folder, files in folders_and_files:
        subprocess.run(["protoc", f"--proto_path={proto_folder}", f"--python_out={folder}", *files], check=True)
    sys.path.insert(0, folder)
    # Beside the packages of the same names that protobuf has.
    import google
    google.__path__.append(f"{folder}/google")
    import grpc as grpc_package
    grpc_package.__path__.append(f"{folder}/grpc")


class Reflection:
    def __init__(self, channel):
        from grpc.reflection.v1alpha import reflection_pb2
        self.messages = reflection_pb2
        self.ask_stream = channel.stream_stream(
            "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
            request_serializer=reflection_pb2.ServerReflectionRequest.SerializeToString,
            response_deserializer=reflection_pb2.ServerReflectionResponse.FromString)
        self.pool = descriptor_pool.DescriptorPool()
        self.known = set()

    def ask(self, **question):
        request = self.messages.ServerReflectionRequest(**question)
        return next(iter(self.ask_stream(iter([request]), timeout=PATIENCE_S)))

    def services(self):
        return [service.name for service in self.ask(list_services="").list_services_response.service]

    def add_file(self, answer):
        if answer.HasField("error_response"):
            raise SystemExit(f"no schema: {answer.original_request}{answer.error_response}")
        for data in answer.file_descriptor_response.file_descriptor_proto:
            file = descriptor_pb2.FileDescriptorProto.FromString(data)
            if file.name in self.known:
                continue
            self.known.add(file.name)
            for dependency in file.dependency:
                self.add_file(self.ask(file_by_filename=dependency))
            self.pool.Add(file)

    def methods(self, service):
        self.add_file(self.ask(file_containing_symbol=service))
        return self.pool.FindServiceByName(service).methods


def outcome(channel, path, method):
    """Status code and reason of a call with an empty message."""
    from google.rpc import error_details_pb2, status_pb2
    proto = descriptor_pb2.MethodDescriptorProto()
    method.CopyToProto(proto)
    arity = [("unary", "stream")[streaming] for streaming in (proto.client_streaming, proto.server_streaming)]
    call = getattr(channel, "_".join(arity))(path)
    try:
        answer = call(iter([b""]) if proto.client_streaming else b"", timeout=PATIENCE_S)
        if proto.server_streaming:
            next(iter(answer), None)  # a watch does not end by itself
            answer.cancel()
        return "OK", "-"
    except grpc.RpcError as error:
        trailers = dict(error.trailing_metadata() or ())
        status = status_pb2.Status.FromString(trailers.get("grpc-status-details-bin", b""))
        info = error_details_pb2.ErrorInfo()
        found = [detail for detail in status.details if detail.Unpack(info)]
        agrees = found and info.domain == "tissueform" and status.message == error.details() \
            and status.code == error.code().value[0]
        return error.code().name, info.reason if agrees else ""


def main():
    address, grpc_protos, google_protos = sys.argv[1:]
    import_messages([(grpc_protos, ["grpc/reflection/v1alpha/reflection.proto"]),
                     (google_protos, ["google/rpc/status.proto", "google/rpc/error_details.proto"])])
    without_reason = 0
    with grpc.insecure_channel(address) as channel:
        reflection = Reflection(channel)
        for service in sorted(reflection.services()):
            methods = reflection.methods(service)
            if not service.startswith("tissueform."):
                print(service)
                continue
            for method in methods:
                path = f"/{service}/{method.name}"
                code, reason = outcome(channel, path, method)
                without_reason += not reason
                print(path[1:], code, reason or "WITHOUT A REASON")
    sys.exit(1 if without_reason else 0)


if __name__ == "__main__":
    main()
