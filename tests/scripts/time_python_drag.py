#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Compares the Python package's drag with that of the C++ client: same plan, model, vertices and rate, alternating on one server.

  time_python_drag.py PROGRAMS PLAN    by a Python that has the package: BUILD/test_scratch/python_package/venv/bin/python

Prints medians of the rounds in ms: from sending a pose to having its frame, the same by grpcio alone and by grpc.aio alone (their calls
and the messages as bytes, nothing of the package: the least that a Python client by grpcio can need), how long prepared answers take to evaluate in Python, and how
long a frame of 100,000 vertices takes to decode. PLAN: with handles and fixed vertices by point_data.
"""

import asyncio
import json
import pathlib
import queue
import statistics
import subprocess
import sys
import tempfile
import time

import grpc
import meshio
import numpy as np
import tissueform
from tissueform import Pose
from tissueform.poses import poses_to_proto
from tissueform.predictions import frame_of
from tissueform.v1 import deform_service_pb2

METHOD = "/tissueform.v1.DeformService/Deform"
ROUNDS, SECONDS, RATES = 5, 3, (30, 300, 1000)


def vertices_of(region, mesh):
    return mesh.point_data[region["point_data"]] == region["equals"]


def make_session(client, plan, folder):
    mesh = meshio.read(folder / plan["mesh"])
    uploaded = client.upload_mesh(*tissueform.from_meshio(mesh))
    handles = {handle["name"]: vertices_of(handle["region"], mesh) for handle in plan["handles"]}
    return client.create_session(uploaded, fixed=vertices_of(plan["fixed"], mesh), handles=handles, model="linear_elastic")


def pose_of(session, i):
    return {session.handles[0]: Pose(translation_mm=(0, 0.02 * (i % 100), 0))}


def message_of(**message):
    return deform_service_pb2.DeformRequest(**message).SerializeToString()


def messages_of(session, rate):
    """The configuration of a drag, and each pose with its acknowledgment: made before they are sent."""
    with session.drag(vertices="skin", prepared=True) as drag:
        configuration = message_of(configuration=drag._configuration)
    return configuration, [(message_of(pose=deform_service_pb2.PoseUpdate(sequence=i + 1, poses=poses_to_proto(pose_of(session, i), session.handles))),
                            message_of(ack=deform_service_pb2.FrameAck(sequence=i + 1))) for i in range(SECONDS * rate)]


async def asyncio_ms(address, configuration, sent, rate):
    """grpc.aio alone."""
    async with grpc.aio.insecure_channel(address) as channel:
        call = channel.stream_stream(METHOD)()
        await call.write(configuration)
        await call.read()
        times = []
        begin = time.perf_counter()
        for i, (update, acknowledgment) in enumerate(sent):
            await asyncio.sleep(max(0, begin + i / rate - time.perf_counter()))
            start = time.perf_counter()
            await call.write(update)
            await call.read()
            await call.write(acknowledgment)
            times.append(1000 * (time.perf_counter() - start))
        return statistics.median(times)


def grpcio_ms(session, configuration, sent, rate):
    """The blocking calls of grpcio alone; what comes is not read."""
    requests = queue.SimpleQueue()
    requests.put(configuration)
    answers = session._caller.channel.stream_stream(METHOD)(iter(requests.get, None))
    next(answers)
    times = []
    begin = time.perf_counter()
    for i, (update, acknowledgment) in enumerate(sent):
        time.sleep(max(0, begin + i / rate - time.perf_counter()))
        start = time.perf_counter()
        requests.put(update)
        next(answers)
        requests.put(acknowledgment)
        times.append(1000 * (time.perf_counter() - start))
    requests.put(None)
    return statistics.median(times)


def python_ms(session, rate):
    times = []
    with session.drag(vertices="skin", prepared=True) as drag:
        drag.move({})
        begin = time.perf_counter()
        for i in range(SECONDS * rate):
            time.sleep(max(0, begin + i / rate - time.perf_counter()))
            pose = pose_of(session, i)
            start = time.perf_counter()
            drag.move(pose)
            times.append(1000 * (time.perf_counter() - start))
    return statistics.median(times)


def command_ms(programs, plan, address, folder, rate):
    out = pathlib.Path(folder, "load.json")
    subprocess.run([programs / "tissueform", "load", "--plan", plan, "--server", address, "--sessions", "1", "--churn", "0", "--seconds", str(SECONDS),
                    "--rate", str(rate), "--model", "linear_elastic", "--json", out], check=True, capture_output=True)
    return json.loads(out.read_text())["drags"][0]["latency_ms"]["p50"]


def median_ms(function, calls=200):
    times = []
    for _ in range(calls):
        start = time.perf_counter()
        function()
        times.append(1000 * (time.perf_counter() - start))
    return statistics.median(times)


def decode_ms():
    data = deform_service_pb2.DeformFrame(sequence=1, positions=np.zeros((100_000, 3), dtype=np.float32).tobytes()).SerializeToString()
    return median_ms(lambda: frame_of(deform_service_pb2.DeformFrame.FromString(data), None))


def main():
    programs, path = map(pathlib.Path, sys.argv[1:])
    plan = json.loads(path.read_text())
    with tissueform.local(programs / "tissueform-server") as server, server.connect() as client, tempfile.TemporaryDirectory() as folder:
        with make_session(client, plan, path.parent) as session:
            for rate in RATES:
                messages = messages_of(session, rate)
                rounds = [(command_ms(programs, path, server.address, folder, rate), python_ms(session, rate), grpcio_ms(session, *messages, rate),
                           asyncio.run(asyncio_ms(server.address, *messages, rate))) for _ in range(ROUNDS)]
                command, *others = (statistics.median(times) for times in zip(*rounds))
                named = zip(("Python", "grpcio alone", "grpc.aio alone"), others)
                print(f"{rate} poses/s: C++ {command:.2f} ms; " + "; ".join(f"{name} {ms:.2f} ms, {ms / command:.2f} times" for name, ms in named))
            answers = session.prepared_answers(vertices="skin")
            pose = {session.handles[0]: Pose(translation_mm=(0, 2, 0))}
            print(f"prepared answers of the skin, evaluated here: {median_ms(lambda: answers.evaluate(pose)):.2f} ms")
    print(f"decoding 100,000 vertices: {decode_ms():.2f} ms")


if __name__ == "__main__":
    main()
