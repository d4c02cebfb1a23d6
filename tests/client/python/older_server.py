# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A server of an earlier protocol: today's server behind a proxy that knows only the messages and methods of that protocol."""

from concurrent import futures

import grpc
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory


def _message_class(pool, name):
    descriptor = pool.FindMessageTypeByName(name)
    get = getattr(message_factory, "GetMessageClass", None)  # protobuf 4.22
    return get(descriptor) if get else message_factory.MessageFactory(pool).GetPrototype(descriptor)


def _filtered(message_class, data):
    """What an older program keeps of a message: fields that it does not know are ignored."""
    message = message_class.FromString(data)
    message.DiscardUnknownFields()
    return message.SerializeToString()


class _Methods(grpc.GenericRpcHandler):
    def __init__(self, descriptors, channel):
        pool = descriptor_pool.DescriptorPool()
        for file in descriptors.file:
            pool.Add(file)
        self._channel = channel
        self._types = {}
        for file in descriptors.file:
            for service in file.service:
                for method in service.method:
                    types = [_message_class(pool, name.lstrip(".")) for name in (method.input_type, method.output_type)]
                    self._types[f"/{file.package}.{service.name}/{method.name}"] = types

    def service(self, handler_call_details):
        types = self._types.get(handler_call_details.method)
        if types is None:
            return None  # UNIMPLEMENTED, as of every method that a server does not have

        def forward(requests, context):
            # All kinds of calls look the same on the wire.
            call = self._channel.stream_stream(handler_call_details.method)(_filtered(types[0], request) for request in requests)
            context.add_callback(call.cancel)
            try:
                for response in call:
                    yield _filtered(types[1], response)
            except grpc.RpcError as error:
                context.set_trailing_metadata(error.trailing_metadata())
                context.abort(error.code(), error.details())
        return grpc.stream_stream_rpc_method_handler(forward)


class OlderServer:
    """descriptors: the file of a FileDescriptorSet. address: of today's server. Use it in a `with` block."""

    def __init__(self, descriptors, address):
        self._channel = grpc.insecure_channel(address)
        self._server = grpc.server(futures.ThreadPoolExecutor(max_workers=16))
        known = descriptor_pb2.FileDescriptorSet.FromString(descriptors.read_bytes())
        self._server.add_generic_rpc_handlers((_Methods(known, self._channel),))
        self.address = f"127.0.0.1:{self._server.add_insecure_port('127.0.0.1:0')}"
        self._server.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._server.stop(None).wait()
        self._channel.close()
