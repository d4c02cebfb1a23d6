# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What clients of a cluster received, and what that forbids from then on. Any thread."""

import collections
import threading
import time

GAP_S = 0.5  # a drag that shows nothing new for so long is written down
ON_ITS_WAY_S = 0.5  # a frame that left its server may arrive so much later


class Ledger:
    def __init__(self):
        self.lock = threading.Lock()
        self.violations = []
        self.counts = collections.Counter()
        self.ends = collections.Counter()  # of streams, by code and reason
        self.meshes = {}  # name: vertices
        self.sessions = {}  # name: (mesh, etag)
        self.deleted = set()
        self.predictions = {}  # name: (session, digest of its positions)
        self.committed_to = {}  # session: the newest sequence that was acknowledged
        self.sent = collections.defaultdict(dict)  # session: sequence of a commit to the server that it was sent to
        self.refused_commits = collections.Counter()
        self.gaps = []  # (session, from, to, node before, node after)
        self.last_frames = {}
        self.streams = collections.defaultdict(list)  # session: streams with a frame, by their first one

    def violation(self, text):
        with self.lock:
            self._violation(text)

    def _violation(self, text):
        if len(self.violations) < 100:
            print(f"VIOLATION: {text}", flush=True)
        self.violations.append(text)

    def count(self, what, by=1):
        with self.lock:
            self.counts[what] += by

    # Drags

    def stream_ended(self, session, code, reason, text):
        with self.lock:
            self.ends[f"{code.name} {reason or text[:60]}"] += 1

    def commit_sent(self, stream, sequence):
        with self.lock:
            self.sent[stream.drag.session][sequence] = stream.server

    def sent_by(self, session, sequence):
        """The server that this commit was sent to; None: there was none."""
        with self.lock:
            return self.sent[session].get(sequence)

    def frame(self, stream, sequence):
        now, session = time.monotonic(), stream.drag.session
        with self.lock:
            self.counts["frames"] += 1
            if stream.first_frame_at is None:
                stream.first_frame_at = now
                self.streams[session].append(stream)
            self._check_owner(stream, sequence, now, "a frame")
            before = self.last_frames.get(session)
            if before is not None and now - before[0] > GAP_S:
                self.gaps.append((session, before[0], now, before[1], stream.node))
            self.last_frames[session] = (now, stream.node)

    def committed(self, stream, sequence, failure):
        now, session = time.monotonic(), stream.drag.session
        with self.lock:
            if failure:
                self.refused_commits[failure] += 1
                return
            self.counts["commits"] += 1
            self._check_owner(stream, sequence, now, "a commit")
            self.committed_to[session] = max(sequence, self.committed_to.get(session, 0))

    def _check_owner(self, stream, sequence, now, what):
        """Whoever has shown a frame later is the owner: nothing that was sent after that, or that comes much later, may be answered by
        an older stream of another node."""
        for other in reversed(self.streams[stream.drag.session]):
            if other is stream or other.first_frame_at < (stream.first_frame_at or now):
                return
            if other.server == stream.server:
                continue
            sent_at = stream.sent_at.get(sequence, 0)
            if sent_at > other.first_frame_at or now > other.first_frame_at + ON_ITS_WAY_S:
                self._violation(f"two owners of {stream.drag.session}: {stream.node} gave {what} of pose {sequence} "
                                f"{now - other.first_frame_at:.3f} s after {other.node} had shown its first frame")
                return

    # Resources

    def mesh(self, name, vertices):
        with self.lock:
            self.counts["meshes"] += 1
            self.meshes[name] = vertices

    def session(self, name, mesh, etag):
        with self.lock:
            self.counts["sessions"] += 1
            self.sessions[name] = (mesh, etag)

    def going(self, name):
        """It is being deleted: from now on nobody knows, until deleted()."""
        with self.lock:
            self.sessions.pop(name, None)

    def deleted_session(self, name):
        with self.lock:
            self.counts["deletions"] += 1
            self.deleted.add(name)

    def prediction(self, name, session, digest):
        with self.lock:
            self.counts["predictions"] += 1
            self.predictions[name] = (session, digest)
