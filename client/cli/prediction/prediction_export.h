// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "nlohmann/json.hpp"

#include "client/cpp/tissueform_client.h"
#include "core/base/types.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/plan_io.h"
#include "tissueform/v1/prediction.pb.h"

namespace tissueform {

// What a prediction is of: the server keeps where vertices went, files on this side have the tets.
struct PredictionMesh {
  Plan plan;            // of a mesh alone: its path and nothing else
  PlanProblem problem;  // of a mesh alone: without what a result does not need
};

// The plan at `path`, or the mesh file at `path` as it is (LPS).
//
// Errors: those of ReadPlan, ResolvePlan and ReadTetMesh; FailedPrecondition: it is not the mesh of
// the prediction, by the SHA-256 of its payload.
absl::StatusOr<PredictionMesh> ReadPlanOf(const v1::Prediction& prediction, const std::string& path,
                                          const PlanReadOptions& reading);
absl::StatusOr<PredictionMesh> ReadMeshOf(const v1::Prediction& prediction,
                                          const std::string& path);

// The boundary of the mesh at `deformed` (#V by 3, LPS) as .stl or .ply, in the plan's own axes.
// Errors: those of WriteTriangleMesh.
absl::Status WriteSkin(const std::string& path, const PlanProblem& problem,
                       const Positions& deformed);

// Where it comes from: mesh, model and settings, poses, quality, software, time, notice.
nlohmann::ordered_json ProvenanceJson(const v1::Prediction& prediction);

// Writes by the ending of `path`: .vtu (WriteResult, with the band of uncertainty where the plan
// has ranges and still makes what was predicted), .stl or .ply (WriteSkin), each with its
// provenance in a file PATH.json beside it; or .json, the provenance with the positions of all
// vertices in LPS, for which `mesh` may be null.
//
// Errors: InvalidArgument for another ending or a missing mesh; those of the writers.
absl::Status ExportPrediction(const std::string& path, const v1::Prediction& prediction,
                              const PredictionMesh* mesh, const Positions& positions);

// What is shown of a prediction: of `mesh`, where one is named, its own surfaces; else its case,
// which the server has.
//
// Errors: InvalidArgument: it names no case either, or the mesh has no skin; FailedPrecondition:
// the case is of another mesh; those of CaseCalls::Read and ParseCase.
absl::StatusOr<CaseFile> ShownCase(const PredictionMesh* mesh, const v1::Prediction& prediction,
                                   TissueformClient* client);

// Before and after, in `folder` (WriteBeforeAndAfter). `contents` is of the mesh of the prediction.
absl::Status WritePicturesOf(const std::string& folder, const v1::Prediction& prediction,
                             const CaseFile& contents, const Positions& positions);

}  // namespace tissueform
