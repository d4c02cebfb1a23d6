# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A drag: poses go up, frames come down, and a broken connection is opened again."""

from __future__ import annotations

import queue
import threading
import time
from typing import Any, Callable, Iterator, List, Optional, Sequence, Tuple, Type

import grpc
import numpy as np
import numpy.typing as npt

from ._calls import FAILOVER_SECONDS, Backoff, Caller, Metadata
from .errors import Cancelled, ServerError, ServerUnavailable, TissueformError, error_of_call, is_transient
from .poses import Poses, add_poses
from .predictions import Frame, frame_of
from .v1 import deform_service_pb2, deform_service_pb2_grpc

# A stream that ends sooner has come to nothing: the waits between attempts go on growing.
_LASTING_SECONDS = 2.0
_TOKEN_PERIOD_SECONDS = 1.0

Notice = deform_service_pb2.DeformNotice


class _Requests(Iterator[Any]):
    """What one stream sends; gRPC reads it on a thread of its own. Sends a renewed token within a second."""

    def __init__(self, caller: Caller) -> None:
        self._caller = caller
        self._token = caller.token.current()
        self._queue: "queue.SimpleQueue[Any]" = queue.SimpleQueue()

    def put(self, request: deform_service_pb2.DeformRequest) -> None:
        self._queue.put(request)

    def close(self) -> None:
        self._queue.put(None)

    def __next__(self) -> Any:
        while True:
            try:
                request = self._queue.get(timeout=_TOKEN_PERIOD_SECONDS)
            except queue.Empty:
                token = self._caller.token.current()
                if token == self._token:
                    continue
                self._token = token
                return deform_service_pb2.DeformRequest(token=token)
            if request is None:
                raise StopIteration
            return request


class _Stream:
    """One call of DeformService.Deform that has begun."""

    def __init__(self, call: Any, requests: _Requests, started: deform_service_pb2.DeformStarted) -> None:
        self.call = call
        self.requests = requests
        self.started = started
        self.unacknowledged: Optional[deform_service_pb2.FrameAck] = None  # the receiving thread's

    def acknowledge(self) -> None:
        """The frame that was received last has been used."""
        if self.unacknowledged is not None:
            self.requests.put(deform_service_pb2.DeformRequest(ack=self.unacknowledged))
            self.unacknowledged = None

    def end(self) -> None:
        self.call.cancel()
        self.requests.close()


class Drag:
    """A drag of a session's handles. Made by Session.drag; use it in a `with` block, which ends it.

        with session.drag(prepared=True) as drag:
            frame = drag.move({"jaw": Pose(translation_mm=(0, -4, 0))})

    At the end of the block poses that were sent with commit are durable.

    Or send poses on one thread, and iterate over the frames on another. The newest pose wins: poses that the server has not begun are
    replaced. If the connection breaks, or the server starts again, the drag continues within reconnect_timeout: the newest pose is sent
    again. One thread may receive while others send. vertices: numbers in the mesh of the vertices of the frames, (#V,) int32; None: all.
    """

    def __init__(self, caller: Caller, handles: Sequence[str], configuration: deform_service_pb2.DeformConfiguration, *,
                 reconnect_timeout: float = 60.0, on_notice: Optional[Callable[[Notice], None]] = None) -> None:
        self._caller = caller
        self._handles = list(handles)
        self._configuration = configuration
        self._reconnect_timeout = reconnect_timeout
        self._on_notice = on_notice
        self._stub = caller.stub(deform_service_pb2_grpc.DeformServiceStub)
        self._lock = threading.Lock()  # sequences must rise
        self._cancelled = threading.Event()
        self._sequence = 0
        self._newest: Optional[deform_service_pb2.PoseUpdate] = None
        self._uncommitted: Optional[deform_service_pb2.PoseUpdate] = None
        self._commit_failure = ""
        self._closed = False
        self._backoff = Backoff()
        self._may_be_at_once = True
        self._attached_at: Optional[float] = None
        self.last_committed: Optional[int] = None
        self.reattachments = 0
        self._stream: Optional[_Stream] = self._open(FAILOVER_SECONDS)
        started = self._stream.started
        self.vertex_count: int = started.vertex_count
        numbers = np.array(started.vertices, dtype=np.int32)
        self.vertices: Optional[npt.NDArray[np.int32]] = numbers if len(numbers) > 0 else None

    # Sending.

    def send(self, poses: Poses, *, commit: bool = False) -> int:
        """Sends poses, one for each handle that moves; the others rest. Returns at once, with the number (sequence) of these poses.
        commit: the server stores them as the session's poses (last_committed shows when they are durable).

        Errors: InvalidInput. Whether they arrive is seen where frames are received.
        """
        request = deform_service_pb2.DeformRequest()
        update = request.pose
        update.commit = commit
        add_poses(update.poses, poses, self._handles)
        with self._lock:
            if self._closed:
                raise Cancelled("the drag is closed: no poses can be sent", advice="open another drag")
            self._sequence += 1
            update.sequence = self._sequence
            self._newest = update
            if commit:
                self._uncommitted = update
            if self._stream is not None:
                self._stream.requests.put(request)
            return self._sequence

    def move(self, poses: Poses, *, commit: bool = False, final: bool = False) -> Frame:
        """Sends poses and returns the first frame that answers them; with `final` the one after which no better one follows.
        Frames of earlier poses are dropped.

        Errors: InvalidInput; those of `receive`; ServerUnavailable (the drag has ended).
        """
        sequence = self.send(poses, commit=commit)
        while True:
            frame = self.receive()
            if frame is None:
                raise ServerUnavailable("the drag ended before the pose was answered", advice="open another drag")
            if frame.sequence >= sequence and not (final and frame.refining):
                self._acknowledge()
                return frame

    def close(self) -> None:
        """No more poses; the newest one is still answered, then `receive` returns None."""
        with self._lock:
            self._closed = True
            if self._stream is not None:
                self._stream.requests.close()

    def cancel(self) -> None:
        """Ends the drag at once, on any thread."""
        self._cancelled.set()
        with self._lock:
            self._closed = True
            if self._stream is not None:
                self._stream.end()

    # Receiving.

    def receive(self) -> Optional[Frame]:
        """Acknowledges the last frame, and blocks until the next one; None: the drag has ended.

        Errors: the server's, and ServerUnavailable if the connection does not come back within reconnect_timeout.
        """
        while True:
            stream = self._stream
            if stream is None:
                return None
            stream.acknowledge()
            try:
                message = self._next_frame(stream)
            except grpc.RpcError as raised:
                error = error_of_call(raised, was_cancelled=self._cancelled.is_set())
                stream.end()
                with self._lock:
                    self._stream = None
                if self._cancelled.is_set():
                    return None
                self._reattach(error)
                continue
            if message is None:
                stream.end()
                with self._lock:
                    self._stream = None
                return None
            stream.unacknowledged = deform_service_pb2.FrameAck(sequence=message.sequence, refinement=message.refinement)
            return frame_of(message, self.vertices)

    def _acknowledge(self) -> None:
        """At once, not with the next pose: the server needs the acknowledgment before it may answer that one."""
        if self._stream is not None:
            self._stream.acknowledge()

    def _next_frame(self, stream: _Stream) -> Optional[deform_service_pb2.DeformFrame]:
        for response in stream.call:
            if response.HasField("frame"):
                frame: deform_service_pb2.DeformFrame = response.frame
                return frame
            if response.HasField("notice"):
                self._take(response.notice)
        return None

    def _take(self, notice: Notice) -> None:
        if notice.HasField("committed") and notice.committed.failure:
            self._commit_failure = notice.committed.failure
        elif notice.HasField("committed"):
            with self._lock:
                self.last_committed = notice.committed.sequence
                if self._uncommitted is not None and self._uncommitted.sequence <= notice.committed.sequence:
                    self._uncommitted = None
        if self._on_notice is not None:
            self._on_notice(notice)

    def __iter__(self) -> Iterator[Frame]:
        """The frames until the drag ends."""
        while True:
            frame = self.receive()
            if frame is None:
                return
            yield frame

    def __enter__(self) -> "Drag":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], *_: object) -> None:
        try:
            if kind is None:
                self.finish()
        finally:
            self.cancel()

    def finish(self) -> None:
        """Waits until the poses that were sent with `commit` are durable; at once where none wait. No more poses can be sent.

        Errors: those of `receive`; ServerError (the server could not store them).
        """
        if self._uncommitted is None:
            return
        self.close()
        for _ in self:
            pass
        if self._uncommitted is not None and not self._cancelled.is_set():
            raise ServerError(f"the poses were not committed: {self._commit_failure or 'the drag ended before'}", advice="commit them again")

    # Opening.

    def _open(self, patience: float) -> _Stream:
        def attempt(metadata: Metadata) -> Tuple[_Stream, Any]:
            requests = _Requests(self._caller)
            requests.put(deform_service_pb2.DeformRequest(configuration=self._configuration))
            call = self._stub.Deform(requests, metadata=metadata)
            try:
                first = next(call)
                if not first.HasField("started"):
                    raise ServerError("the drag began with another message than started")
                return _Stream(call, requests, first.started), call.initial_metadata()
            except BaseException:
                call.cancel()
                requests.close()
                raise
        return self._caller.run(attempt, self._configuration.session, patience=patience)

    def _reattach(self, why: TissueformError) -> None:
        """Opens another stream: at once if the session has moved, otherwise after growing waits. Raises the last error."""
        give_up = time.monotonic() + self._reconnect_timeout
        if self._attached_at is not None and time.monotonic() >= self._attached_at + _LASTING_SECONDS:
            self._backoff.reset()
            self._may_be_at_once = True
        at_once = self._may_be_at_once and why.reason == "SESSION_MOVED"
        self._may_be_at_once = False
        while is_transient(why):
            wait = 0.0 if at_once else self._backoff.after(why)
            at_once = False
            if time.monotonic() + wait > give_up:
                raise why
            if self._cancelled.wait(wait):
                return
            try:
                stream = self._open(patience=0.0)
            except TissueformError as error:
                why = error
                continue
            self.reattachments += 1
            self._attached_at = time.monotonic()
            self._adopt(stream)
            return
        raise why

    def _adopt(self, stream: _Stream) -> None:
        with self._lock:
            self._stream = stream
            for pose in self._unanswered():
                stream.requests.put(deform_service_pb2.DeformRequest(pose=pose))
            if self._cancelled.is_set():
                stream.end()
            elif self._closed:
                stream.requests.close()

    def _unanswered(self) -> List[deform_service_pb2.PoseUpdate]:
        """What the next stream is sent: the pose that waits to be committed, and the newest one."""
        poses = []
        if self._uncommitted is not None and self._newest is not None and self._uncommitted.sequence < self._newest.sequence:
            poses.append(self._uncommitted)
        if self._newest is not None:
            newest = deform_service_pb2.PoseUpdate()
            newest.CopyFrom(self._newest)
            newest.commit = self._uncommitted is not None and self._uncommitted.sequence == newest.sequence
            poses.append(newest)
        return poses
