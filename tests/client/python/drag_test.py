# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Drags on a real server: frames, commits, interruptions, asyncio, and a server that is killed."""

import asyncio
import os
import pathlib
import signal
import subprocess
import tempfile
import threading
import time
import unittest

import numpy as np
import tissueform
from programs import SERVER, start_server
from tissueform import Pose, sample_bar

points, tets = sample_bar()


def setUpModule():
    global server, client
    server = start_server()
    client = server.connect()


def tearDownModule():
    client.close()
    server.close()


def make_session(of=None, **options):
    of = of or client
    return of.create_session(of.upload_mesh(points, tets, stiffness=5000.0), fixed=points[:, 2] == 0, handles={"end": points[:, 2] == 40}, **options)


def shifted(y):
    return {"end": Pose(translation_mm=(0, y, 0))}


class DragTest(unittest.TestCase):
    def test_frames_answer_their_poses(self):
        with make_session() as session, session.drag() as drag:
            for y in (1.0, 2.0, 3.0):
                frame = drag.move(shifted(y))
                np.testing.assert_array_equal(frame.positions, session.predict(shifted(y)).positions)
            self.assertEqual((frame.sequence, drag.reattachments), (3, 0))

    def test_frames_of_a_selection_know_their_vertices(self):
        with make_session() as session, session.drag(vertices="skin", prepared=tissueform.Prepared(tolerance_mm=0.005)) as drag:
            frame = drag.move(shifted(2))
            self.assertTrue(frame.summary.prepared)
            self.assertLessEqual(np.abs(frame.positions - session.predict(shifted(2)).positions[frame.vertices]).max(), 0.005 + 1e-4)
            self.assertEqual(frame.displacements(points).shape, (drag.vertex_count, 3))

    def test_the_final_frame_is_refined(self):
        with make_session(model="neo_hookean") as session, session.drag(prepared=True) as drag:
            self.assertTrue(drag.move(shifted(3)).refining)
            final = drag.move(shifted(4), final=True)
            self.assertFalse(final.refining)
            self.assertTrue(final.converged)

    def test_iteration_ends_after_the_newest_pose_when_it_is_closed(self):
        with make_session() as session, session.drag() as drag:
            for y in range(20):
                drag.send(shifted(y))
            drag.close()
            frames = list(drag)
            self.assertEqual(frames[-1].sequence, 20)
            self.assertEqual(len(frames) + sum(frame.skipped for frame in frames), 20)
            with self.assertRaises(tissueform.Cancelled):
                drag.send(shifted(0))

    def test_a_committed_pose_is_the_session_s(self):
        notices = []
        with make_session() as session, session.drag(on_notice=notices.append) as drag:
            drag.move(shifted(2), commit=True)
            drag.finish()
            self.assertEqual(drag.last_committed, 1)
            session.refresh()
            self.assertEqual(session.committed_poses["end"].translation_mm, (0, 2, 0))
        self.assertTrue(any(notice.HasField("committed") for notice in notices))

    def test_the_end_of_the_block_waits_for_a_commit(self):
        with make_session() as session:
            with session.drag() as drag:
                drag.send(shifted(2), commit=True)
            self.assertEqual(drag.last_committed, 1)
            session.refresh()
            self.assertEqual(session.committed_poses["end"].translation_mm, (0, 2, 0))

    def test_ctrl_c_in_the_middle_ends_the_drag_and_leaves_the_session(self):
        with make_session() as session:
            threading.Timer(0.3, lambda: signal.raise_signal(signal.SIGINT)).start()
            with self.assertRaises(KeyboardInterrupt), session.drag() as drag:
                drag.move(shifted(1))
                drag.receive()  # nothing more comes
            with session.drag() as again:
                self.assertEqual(again.move(shifted(1)).sequence, 1)

    def test_a_block_s_own_error_is_not_hidden_by_a_server_that_is_gone(self):
        with start_server() as other, other.connect() as own:
            with self.assertRaises(ZeroDivisionError), make_session(own):
                other.close()
                raise ZeroDivisionError

    def test_an_exception_in_the_block_ends_the_drag(self):
        with make_session() as session:
            with self.assertRaises(ZeroDivisionError), session.drag() as drag:
                drag.move({"end": Pose(translation_mm=(0, 1 / 0, 0))})
            self.assertIsNone(drag.receive())

    def test_one_thread_sends_while_another_receives(self):
        with make_session() as session, session.drag() as drag:
            received = []
            receiver = threading.Thread(target=lambda: received.extend(frame.sequence for frame in drag))
            receiver.start()
            for y in range(200):
                drag.send(shifted(0.01 * y))
            drag.close()
            receiver.join(timeout=30)
        self.assertEqual(received[-1], 200)
        self.assertEqual(received, sorted(received))

    def test_a_session_that_is_deleted_ends_the_drag(self):
        session = make_session()
        with session.drag() as drag:
            drag.move(shifted(1))
            session.delete()
            with self.assertRaises(tissueform.NotFound):
                drag.move(shifted(2))

    def test_a_thousand_sessions_leave_nothing(self):
        mesh = client.upload_mesh(points, tets, stiffness=5000.0)
        memory, threads = [], threading.active_count()
        for number in range(1000):
            with client.create_session(mesh, fixed=points[:, 2] == 0, handles={"end": points[:, 2] == 40}) as session:
                if number % 10 == 0:
                    with session.drag() as drag:
                        drag.move(shifted(1))
            if number in (499, 999):
                memory.append(int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
        self.assertEqual(list(client.sessions()), [])
        self.assertLess(memory[1] - memory[0], 4 << 20)
        give_up = time.monotonic() + 5
        while threading.active_count() > threads and time.monotonic() < give_up:
            time.sleep(0.05)
        self.assertLessEqual(threading.active_count(), threads)


class AsyncDragTest(unittest.IsolatedAsyncioTestCase):
    async def test_frames_come_while_the_loop_runs(self):
        with make_session() as session:
            async with session.async_drag(prepared=True) as drag:
                frame = await drag.move(shifted(2))
                self.assertEqual(frame.sequence, 1)
                for y in range(5):
                    drag.send(shifted(y))
                drag.close()
                sequences = [frame.sequence async for frame in drag]
        self.assertEqual(sequences[-1], 6)

    async def test_the_end_of_the_block_waits_for_a_commit(self):
        with make_session() as session:
            async with session.async_drag() as drag:
                drag.send(shifted(2), commit=True)
            self.assertEqual(drag.drag.last_committed, 1)

    async def test_several_drags_run_side_by_side(self):
        with make_session() as session:
            async def move(y):
                async with session.async_drag() as drag:
                    for _ in range(5):
                        frame = await drag.move(shifted(y))
                    return frame.positions
            found = await asyncio.gather(*(move(y) for y in range(4)))
            for y, positions in enumerate(found):
                np.testing.assert_array_equal(positions, session.predict(shifted(y)).positions)

    async def test_a_canceled_task_ends_its_drag(self):
        with make_session() as session:
            async with session.async_drag() as drag:
                await drag.move(shifted(1))
                task = asyncio.create_task(drag.receive())
                await asyncio.sleep(0.1)
                task.cancel()
                with self.assertRaises(asyncio.CancelledError):
                    await task
                with self.assertRaises(tissueform.Cancelled):
                    drag.send(shifted(2))

    async def test_an_error_at_the_beginning_is_raised(self):
        session = make_session()
        session.delete()
        with self.assertRaises(tissueform.NotFound):
            async with session.async_drag():
                pass


class ReattachmentTest(unittest.TestCase):
    """A server that stores its sessions is killed, and started again on its port."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.address = self.start(0)
        self.client = tissueform.connect(self.address)
        self.addCleanup(self.client.close)

    def start(self, port):
        self.process = subprocess.Popen([SERVER, "--port", str(port), "--data-dir", f"{self.folder.name}/data"], stdout=subprocess.PIPE,
                                        stderr=subprocess.DEVNULL, text=True)
        self.addCleanup(self.kill, self.process)
        return self.process.stdout.readline().split()[-1]

    @staticmethod
    def kill(process):
        process.kill()
        process.wait()
        process.stdout.close()

    def restart(self):
        self.kill(self.process)
        self.start(int(self.address.rpartition(":")[2]))

    def test_a_drag_outlives_its_server(self):
        with make_session(self.client) as session, session.drag() as drag:
            expected = drag.move(shifted(1)).positions
            threading.Timer(0.3, self.restart).start()
            give_up = time.monotonic() + 30
            while drag.reattachments == 0 and time.monotonic() < give_up:
                frame = drag.move(shifted(1))
            np.testing.assert_array_equal(frame.positions, expected)
            self.assertEqual(drag.reattachments, 1)

    def test_a_pose_sent_while_the_server_is_away_is_answered_and_committed(self):
        with make_session(self.client) as session, session.drag() as drag:
            drag.move(shifted(1))
            self.kill(self.process)
            drag.send(shifted(2), commit=True)
            threading.Timer(0.3, self.start, [int(self.address.rpartition(":")[2])]).start()
            frame = drag.move(shifted(3))
            self.assertEqual((frame.sequence, drag.reattachments), (3, 1))
            drag.close()
            list(drag)
            self.assertEqual(drag.last_committed, 2)

    def test_a_server_that_stays_away_ends_the_drag_with_an_error(self):
        session = make_session(self.client)
        with session.drag(reconnect_timeout=0.5) as drag:
            drag.move(shifted(1))
            self.kill(self.process)
            with self.assertRaises(tissueform.ServerUnavailable):
                drag.move(shifted(2))


if __name__ == "__main__":
    unittest.main()
