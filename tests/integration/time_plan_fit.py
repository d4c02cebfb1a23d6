#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Times PlanService.Fit by python3-grpcio: 18 numbers of three segments, ten targets of three numbers each, wanting something else at every call.

  time_plan_fit.py HOST:PORT HEAD.vtu FOLDER_OF_GRPC_PROTOS FOLDER_OF_GOOGLE_RPC_PROTOS

HEAD.vtu: that of tests/data/plans/three_segments. By hand, for docs/plan-fitting.md.
"""

import hashlib
import random
import sys
import time

import grpc
import meshio
import numpy as np

from call_every_rpc import Reflection, import_messages
from send_and_prepare import Messages, upload

MODELS = {"gradient_field": 1, "linear_elastic": 3, "neo_hookean": 4}
CALLS = 100
PATIENCE_S = 300


def main():
    address, head, grpc_protos, google_protos = sys.argv[1:]
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
    targets = [skin[(2 * k + 1) * len(skin) // 20] for k in range(10)]

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
        wishes = random.Random(1)

        def fit(model):
            wanted = [{"name": str(v), "point_mm": dict(zip("xyz", points[v])),
                       "displacement_mm": {axis: wishes.uniform(-4, 4) for axis in "xyz"}} for v in targets]
            start = time.perf_counter()
            answer = call("/tissueform.v1.PlanService/Fit",
                          messages("FitRequest")(session=session, targets=wanted, freedoms=freedoms, model=model),
                          "FitResponse")
            return time.perf_counter() - start, answer

        for model, number in MODELS.items():
            prepared_s = fit(number)[0]
            answers = [fit(number) for _ in range(CALLS)]
            total, search = (np.array(values) * 1e3 for values in (
                [seconds for seconds, _ in answers], [answer.search_seconds for _, answer in answers]))
            converged = sum(answer.converged for _, answer in answers)
            print(f"{model}: first call {prepared_s:.2f} s; then p50 {np.median(total):.1f} ms, "
                  f"p99 {np.percentile(total, 99):.1f} ms, of it the search {np.median(search):.1f} ms; "
                  f"{converged} of {CALLS} converged")


if __name__ == "__main__":
    main()
