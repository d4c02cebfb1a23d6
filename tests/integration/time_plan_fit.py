#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Times PlanService.Fit by python3-grpcio: 18 numbers of three segments, ten targets of three numbers each.

  time_plan_fit.py HOST:PORT HEAD.vtu FOLDER_OF_GRPC_PROTOS FOLDER_OF_GOOGLE_RPC_PROTOS [--json FILE --machine TEXT --compiler TEXT --commit HASH]

"jump": every call wants something else and begins at rest. "pull": every call wants a little more than the one before and begins with its answer, as
the planner does; "pull of places": the same of means over three places of the skin. HEAD.vtu: that of tests/data/plans/three_segments. By hand, for docs/plan-fitting.md and docs/results/plan_fit.json.
"""

import argparse
import hashlib
import json
import pathlib
import random
import time

import grpc
import meshio
import numpy as np

from call_every_rpc import Reflection, import_messages
from send_and_prepare import Messages, upload

MODELS = {"gradient_field": 1, "linear_elastic": 3, "neo_hookean": 4}
CALLS = 100
GOALS = 30
PULL_STEPS = 30  # from one goal to the next, up to 8 mm away
PLACES = (1, 4, 6)  # of the head's skin, of 304, 388 and 1,029 vertices
PATIENCE_S = 300


def main():
    parser = argparse.ArgumentParser()
    for name in ("address", "head", "grpc_protos", "google_protos"):
        parser.add_argument(name)
    parser.add_argument("--json", type=pathlib.Path)
    for name in ("machine", "compiler", "commit"):
        parser.add_argument(f"--{name}", default="")
    arguments = parser.parse_args()
    address, head, grpc_protos, google_protos = arguments.address, arguments.head, arguments.grpc_protos, arguments.google_protos
    import_messages([(grpc_protos, ["grpc/reflection/v1alpha/reflection.proto"]),
                     (google_protos, ["google/rpc/status.proto", "google/rpc/error_details.proto"])])
    mesh = meshio.read(head)
    anatomy = mesh.point_data["anatomy"]
    points = mesh.points.astype("<f8")
    tets = mesh.cells_dict["tetra"].astype("<i4")
    stiffness = mesh.cell_data_dict["youngs_modulus_pa"]["tetra"].astype("<f8")
    payload = points.tobytes() + tets.tobytes() + stiffness.tobytes()
    name = "youngs_modulus_pa"
    text = f"tissueform-mesh 1\nvertices {len(points)}\ntets {len(tets)}\ncell_array {len(name)} {name}\n".encode()
    header = {"vertex_count": len(points), "tet_count": len(tets), "cell_arrays": [name], "total_bytes": len(payload),
              "sha256": hashlib.sha256(text + payload).hexdigest()}
    faces = np.sort(np.concatenate([np.delete(tets, k, axis=1) for k in range(4)]), axis=1)
    outer, counts = np.unique(faces, axis=0, return_counts=True)
    skin = [v for v in np.unique(outer[counts == 1]) if anatomy[v] == 0]
    single = [{"point_mm": dict(zip("xyz", points[skin[(2 * k + 1) * len(skin) // 20]]))} for k in range(10)]
    places = [{"vertices": {"vertices": np.flatnonzero(mesh.point_data["skin_region"] == k).tolist()}} for k in PLACES]

    with grpc.insecure_channel(address) as channel:
        reflection = Reflection(channel)
        for service in ("MeshService", "SessionService", "PlanService"):
            reflection.methods(f"tissueform.v1.{service}")
        messages = Messages(reflection.pool)

        def call(method, request, response):
            return channel.unary_unary(method, request_serializer=lambda message: message.SerializeToString(),
                                       response_deserializer=messages(response).FromString)(request, timeout=PATIENCE_S)

        sent = upload(channel, messages, header, payload, 0, len(payload)).mesh.name
        handles = [{"name": f"segment {k}", "vertices": np.flatnonzero(anatomy == k).tolist()} for k in (2, 3, 4)]
        session = call("/tissueform.v1.SessionService/CreateSession",
                       messages("CreateSessionRequest")(
                           mesh=sent, stiffness={"cell_array": name}, handles=handles, model=1,
                           fixed_vertices=np.flatnonzero(anatomy == 1).tolist()), "Session").name
        degrees, mm = {"lowest": -0.17, "highest": 0.17}, {"lowest": -10, "highest": 10}
        freedoms = [{"handle": handle["name"], "rotation_vector": dict(x=degrees, y=degrees, z=degrees),
                     "translation_mm": dict(x=mm, y=mm, z=mm)} for handle in handles]
        def wanted(spots, moves):
            return [{"name": f"spot {k}", "displacement_mm": dict(zip("xyz", move)), **spot} for k, (spot, move) in enumerate(zip(spots, moves))]

        def fit(model, spots, moves, start):
            request = messages("FitRequest")(session=session, targets=wanted(spots, moves), freedoms=freedoms, poses=start, model=model)
            begun = time.perf_counter()
            answer = call("/tissueform.v1.PlanService/Fit", request, "FitResponse")
            return time.perf_counter() - begun, answer

        results = []

        def report(kind, model, answers):
            calls, searches = (np.array(values) * 1e3 for values in (
                [seconds for seconds, _ in answers], [answer.search_seconds for _, answer in answers]))
            figures = {"model": model, "kind": kind, "calls": len(answers), "converged": sum(answer.converged for _, answer in answers),
                       "steps": float(np.mean([answer.iterations for _, answer in answers])),
                       **{f"{what}_ms": {f"p{part}": round(float(np.percentile(of, part)), 3) for part in (50, 95, 99)}
                          for what, of in (("call", calls), ("search", searches))}}
            print("{model}, {kind}: p50 {call_ms[p50]:.1f} ms, p95 {call_ms[p95]:.1f} ms, p99 {call_ms[p99]:.1f} ms, of it the search "
                  "{search_ms[p50]:.1f} / {search_ms[p95]:.1f} / {search_ms[p99]:.1f} ms, {steps:.1f} steps; "
                  "{converged} of {calls} converged".format(**figures))
            results.append(figures)

        for model, number in MODELS.items():
            numbers = random.Random(1)

            def anywhere(spots):
                return np.array([[numbers.uniform(-4, 4) for _ in "xyz"] for _ in spots])

            prepared_s = fit(number, single, 0 * anywhere(single), [])[0]
            print(f"{model}: first call {prepared_s:.2f} s")
            report("jump", model, [fit(number, single, anywhere(single), []) for _ in range(CALLS)])
            for kind, spots in (("pull", single), ("pull of places", places)):
                start, moves, pulls = [], 0 * anywhere(spots), []
                fit(number, spots, moves, start)
                for _ in range(GOALS):
                    begin, goal = moves, anywhere(spots)
                    for step in range(PULL_STEPS):
                        moves = begin + (goal - begin) * (step + 1) / PULL_STEPS
                        pulls.append(fit(number, spots, moves, start))
                        start = pulls[-1][1].poses
                report(kind, model, pulls)
        if arguments.json:
            document = {"machine": arguments.machine, "compiler": arguments.compiler, "commit": arguments.commit,
                        "notice": "research software, not a medical device", "fits": results}
            arguments.json.write_text(json.dumps(document, indent=2) + "\n")


if __name__ == "__main__":
    main()
