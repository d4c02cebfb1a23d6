# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What pages do, without a browser: a drag over a WebSocket (docs/gateway.md), by python3-websockets, and calls by gRPC-Web."""

import asyncio
import base64
import http.client
import struct
import threading
import urllib.error
import urllib.request

import grpc
import websockets

import drags
import stranger

START, MESSAGE, END, BEGIN = 1, 2, 4, 5
HEAD = struct.Struct("<BBHIIIQQ")
UNAVAILABLE = grpc.StatusCode.UNAVAILABLE
CODES = {code.value[0]: code for code in grpc.StatusCode}


class WebError(grpc.RpcError):
    """The end of a call as gRPC's own client would report it."""

    def __init__(self, code, text, status_details=b""):
        super().__init__(text)
        self._code, self._text, self._details = code, text, status_details

    def code(self):
        return self._code

    def details(self):
        return self._text

    def trailing_metadata(self):
        return (("grpc-status-details-bin", self._details),) if self._details else ()


class SocketDrag(drags.Drag):
    """A drag through a gateway."""

    def __init__(self, address, session, handle_rest, ledger):
        super().__init__(address, session, handle_rest, ledger)
        self.url = f"ws://{address}/call"

    def _one_stream(self):
        try:
            asyncio.run(self._one_socket())
        except (OSError, asyncio.TimeoutError, websockets.exceptions.WebSocketException) as error:
            raise WebError(UNAVAILABLE, str(error) or type(error).__name__) from None

    async def _one_socket(self):
        from tissueform.v1 import deform_service_pb2 as protocol, gateway_pb2
        stream = drags.Stream(self, protocol)
        async with websockets.connect(self.url, subprotocols=["tissueform.v1"], max_size=None, open_timeout=5, ping_interval=None) as socket:
            start = gateway_pb2.GatewayCallStart(method="/tissueform.v1.DeformService/Deform", metadata=dict(self.route.metadata()), **({"tells_begin": True} if "tells_begin" in gateway_pb2.GatewayCallStart.DESCRIPTOR.fields_by_name else {}))
            await socket.send(self._frame(START, start))
            loop = asyncio.get_running_loop()
            sender = threading.Thread(target=self._send, args=(stream, socket, loop), daemon=True)
            sender.start()
            try:
                while not self.ending.is_set():
                    data = await asyncio.wait_for(socket.recv(), drags.SILENCE_S)
                    self._take(stream, data)
            finally:
                stream.end()
                await loop.run_in_executor(None, sender.join)

    @staticmethod
    def _frame(kind, message):
        payload = message.SerializeToString()
        return HEAD.pack(1, kind, HEAD.size, len(payload), 0, 0, 0, 0) + payload

    def _send(self, stream, socket, loop):
        try:
            for request in stream.requests():
                asyncio.run_coroutine_threadsafe(socket.send(self._frame(MESSAGE, request)), loop).result(drags.SILENCE_S)
        except Exception:  # pylint: disable=broad-except
            pass  # the socket has ended, which its reader reports

    def _take(self, stream, data):
        from tissueform.v1 import gateway_pb2
        _, kind, begin, _, _, _, _, _ = HEAD.unpack_from(data)
        if kind == BEGIN:
            headers = gateway_pb2.GatewayCallBegin.FromString(data[begin:]).headers
            stream.node = headers.get(stranger.NODE_HEADER, "")
        elif kind == END:
            end = gateway_pb2.GatewayCallEnd.FromString(data[begin:])
            raise WebError(CODES[end.code], end.message, end.status_details)
        else:
            stream.take(stream.protocol.DeformResponse.FromString(data[begin:]))
            if stream.started and stream.node:
                self.route.answered([(stranger.NODE_HEADER, stream.node)])


class WebReader(threading.Thread):
    """Asks for sessions by gRPC-Web all the while."""

    def __init__(self, address, sessions, ledger):
        super().__init__(daemon=True)
        self.url, self.sessions, self.ledger = f"http://{address}", sessions, ledger
        self.ending = threading.Event()

    def stop(self):
        self.ending.set()

    def run(self):
        number = 0
        while not self.ending.wait(0.2):
            session = self.sessions[number % len(self.sessions)]
            number += 1
            self._read(session)

    def _read(self, session):
        from tissueform.v1 import session_pb2, session_service_pb2 as protocol
        payload = protocol.GetSessionRequest(name=session).SerializeToString()
        call = urllib.request.Request(f"{self.url}/tissueform.v1.SessionService/GetSession", data=struct.pack(">BI", 0, len(payload)) + payload,
                                      headers={"content-type": "application/grpc-web+proto", "x-grpc-web": "1",
                                               stranger.SESSION_HEADER: session.removeprefix("sessions/")})
        route = stranger.Route("")
        while not self.ending.is_set():
            try:
                message = self._answer(call)
                if session_pb2.Session.FromString(message).name != session:
                    self.ledger.violation(f"a gateway answered with another session than {session}")
                self.ledger.count("gRPC-Web answers")
                return
            except stranger.Refused as refused:
                self.ledger.violation(f"a gateway refused GetSession: {refused}")
                return
            except grpc.RpcError as error:
                try:
                    self.ending.wait(route.failed(error))
                except stranger.Refused as refused:
                    self.ledger.violation(f"a gateway refused GetSession: {refused}")
                    return

    @staticmethod
    def _answer(call):
        """The one message of the answer; WebError."""
        try:
            with urllib.request.urlopen(call, timeout=stranger.ATTEMPT_S) as reply:
                body, headers = reply.read(), dict(reply.headers)
        except (OSError, urllib.error.URLError, http.client.HTTPException) as error:
            raise WebError(UNAVAILABLE, str(error)) from None
        message, trailers, place = b"", {name.lower(): value for name, value in headers.items()}, 0
        while place < len(body):
            kind, length = struct.unpack_from(">BI", body, place)
            part = body[place + 5:place + 5 + length]
            place += 5 + length
            if kind & 0x80:
                trailers |= dict(line.split(":", 1) for line in part.decode().split("\r\n") if line)
            else:
                message = part
        code = int(trailers.get("grpc-status", "2"))
        if code:
            details = trailers.get("grpc-status-details-bin", "").strip()
            raise WebError(CODES[code], trailers.get("grpc-message", "").strip(), base64.b64decode(details + "=" * (-len(details) % 4)))
        return message
