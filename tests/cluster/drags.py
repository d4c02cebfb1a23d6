# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Drags and followers that go on while parts of their cluster fail, and report what they see to a ledger."""

import contextlib
import itertools
import math
import queue
import struct
import threading
import time

import grpc

import stranger

RATE_S = 0.05
COMMIT_EVERY = 20  # poses
SILENCE_S = 30  # a stream that says nothing for so long is given up
HANDLE = "top"


def pose_of(protocol, sequence, commit=False):
    """The sequence can be read from the committed pose: where nothing turns, a pivot changes nothing."""
    request = protocol.DeformRequest()
    request.pose.sequence, request.pose.commit = sequence, commit
    pose = request.pose.poses.add(handle=HANDLE)
    pose.pivot_mm.x = sequence
    pose.translation_mm.z = shift_mm(sequence)
    return request


def shift_mm(sequence):
    return math.sin(0.1 * sequence)


class Drag(threading.Thread):
    """Drags one session at 20 poses per second until it is stopped. With a node it goes there alone, and never elsewhere."""

    def __init__(self, address, session, handle_rest, ledger, node=None, sequences=None):
        super().__init__(daemon=True)
        self.server = stranger.Stranger(address)
        self.address, self.session, self.ledger, self.pinned = address, session, ledger, node
        self.handle_rest = handle_rest  # place of a vertex of the handle in a frame, and its rest position
        self.route = stranger.Route(session.removeprefix("sessions/"))
        self.sequences = sequences or itertools.count(1)
        self.ending = threading.Event()
        self.last_frame = None  # when, and from which node
        self.stream, self.streams = None, 0

    def stop(self):
        self.ending.set()

    def run(self):
        while not self.ending.is_set():
            if self.pinned:
                self.route.node = self.pinned
            try:
                self._one_stream()
            except grpc.RpcError as error:
                self.ledger.stream_ended(self.session, *stranger.why(error)[:2], error.details())
                try:
                    wait_s = self.route.failed(error)
                except stranger.Refused as refused:
                    self.ledger.violation(f"drag of {self.session} ended: {refused}")
                    return
                self.ending.wait(0.1 if self.pinned else wait_s)
        self.server.close()

    def state(self):
        stream = self.stream
        description = "none" if stream is None else f"{time.monotonic() - stream.begun_at:.1f} s old, from {stream.node or 'no server'}, {'' if stream.started else 'not '}started"
        return f"stream {self.streams}: {description}; sent to {self.route.node or 'any server'}"

    def _one_stream(self):
        from tissueform.v1 import deform_service_pb2 as protocol
        stream = Stream(self, protocol)
        call = self.server.method("DeformService/Deform", protocol.DeformResponse, "stream_stream")(stream.requests(), metadata=self.route.metadata())
        watchdog = threading.Thread(target=stream.watch_silence, args=(call,), daemon=True)
        watchdog.start()
        try:
            stream.node = dict(call.initial_metadata() or ()).get(stranger.NODE_HEADER, "")
            for answer in call:
                stream.take(answer)
                if stream.started:
                    self.route.answered(call.initial_metadata())
        finally:
            stream.end()
            watchdog.join()


class Stream:
    """One stream of a drag."""

    def __init__(self, drag, protocol):
        self.drag, self.protocol = drag, protocol
        self.node, self.started = "", False
        self.first_frame_at = None
        self.sent_at = {}
        # No SimpleQueue: in Python 3.11 its get waits without end where the time is over just as it looks for an item again.
        self.outgoing = queue.Queue()
        self.over = threading.Event()
        self.heard_at = time.monotonic()
        self.begun_at = self.heard_at
        drag.stream, drag.streams = self, drag.streams + 1

    @property
    def server(self):
        """Which server this is, of those of one name too."""
        return self.drag.address if self.drag.pinned else self.node

    def end(self):
        self.over.set()

    def watch_silence(self, call):
        while not self.over.wait(0.25):
            if time.monotonic() - self.heard_at > SILENCE_S:
                call.cancel()

    def requests(self):
        configuration = self.protocol.DeformRequest()
        configuration.configuration.session = self.drag.session
        configuration.configuration.vertices.list.vertices.append(self.drag.handle_rest[0])
        configuration.configuration.prepared.SetInParent()
        yield configuration
        next_at = time.monotonic()
        while not self.over.is_set() and not self.drag.ending.is_set():
            try:
                yield self.outgoing.get(timeout=max(0.001, next_at - time.monotonic()))
                continue
            except queue.Empty:
                pass
            next_at = max(next_at + RATE_S, time.monotonic())
            if self.started:
                sequence = next(self.drag.sequences)
                commit = sequence % COMMIT_EVERY == 0
                self.sent_at[sequence] = time.monotonic()
                if commit:
                    self.drag.ledger.commit_sent(self, sequence)
                yield pose_of(self.protocol, sequence, commit)

    def take(self, answer):
        self.heard_at = time.monotonic()
        if answer.HasField("started"):
            self.started = True
        elif answer.HasField("frame"):
            self._take_frame(answer.frame)
        elif answer.notice.HasField("committed"):
            self.drag.ledger.committed(self, answer.notice.committed.sequence, answer.notice.committed.failure)

    def _take_frame(self, frame):
        drag = self.drag
        self.outgoing.put(self.protocol.DeformRequest(ack={"sequence": frame.sequence}))
        rest_z = drag.handle_rest[1]
        z = struct.unpack_from("<3f", frame.positions)[2]
        if abs(z - rest_z - shift_mm(frame.sequence)) > 0.02:
            drag.ledger.violation(f"frame {frame.sequence} of {drag.session} shows another pose: {z}")
        drag.ledger.frame(self, frame.sequence)
        drag.last_frame = (self.heard_at, self.node)


class Follower(threading.Thread):
    """Follows a session until it is stopped."""

    def __init__(self, address, session, ledger):
        super().__init__(daemon=True)
        self.server = stranger.Stranger(address)
        self.session, self.ledger = session, ledger
        self.route = stranger.Route(session.removeprefix("sessions/"))
        self.ending = threading.Event()
        self.call = None
        self.frames, self.last_frame_at = 0, None

    def stop(self):
        self.ending.set()
        if self.call is not None:
            self.call.cancel()

    def run(self):
        while not self.ending.is_set():
            try:
                self._follow()
            except grpc.RpcError as error:
                if self.ending.is_set():
                    break
                try:
                    self.ending.wait(self.route.failed(error))
                except stranger.Refused as refused:
                    self.ledger.violation(f"follower of {self.session} ended: {refused}")
                    return
        self.server.close()

    def _follow(self):
        from google.protobuf import empty_pb2
        from tissueform.v1 import deform_service_pb2 as protocol
        # A bounded call, since a client that only listens hears nothing of a server that is gone.
        self.call = self.server.method("DeformService/Watch", protocol.WatchResponse, "unary_stream")(
            protocol.WatchRequest(session=self.session), metadata=self.route.metadata(), timeout=60)
        acknowledge = self.server.method("DeformService/AcknowledgeWatch", empty_pb2.Empty)
        watch, number = None, 0
        for answer in self.call:
            self.route.answered(self.call.initial_metadata())
            if answer.HasField("started"):
                watch = answer.started.watch
            elif answer.HasField("frame"):
                if answer.frame.number < number:
                    self.ledger.violation(f"a watch of {self.session} went back from frame {number} to {answer.frame.number}")
                number = answer.frame.number
                self.frames, self.last_frame_at = self.frames + 1, time.monotonic()
                with contextlib.suppress(grpc.RpcError):  # the watch itself says how it ends
                    acknowledge(protocol.AcknowledgeWatchRequest(watch=watch, number=number), metadata=self.route.metadata(), timeout=5)
