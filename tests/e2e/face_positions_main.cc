// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// tissueform-face-positions PLAN MODEL POSES.json OUT
//
// Where the surfaces of a plan are that follow its mesh, under other poses than its own, by the
// prepared answers that `tissueform export` puts into a file: what the browser's answer from that
// file is held against.
// POSES.json: of every handle ten numbers, rotation vector, pivot, translation, scale. OUT: float32
// x y z of the vertices of all such surfaces, one after the other.

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "nlohmann/json.hpp"

#include "client/cli/cases/packed_case.h"
#include "client/cli/export/moving_data.h"
#include "core/base/status_macros.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "core/planning/model_names.h"

namespace tissueform::testing {
namespace {

std::vector<HandlePose> ReadPoses(const std::string& path) {
  std::ifstream file(path);
  std::vector<HandlePose> poses;
  const auto rows = nlohmann::json::parse(file).get<std::vector<std::vector<double>>>();
  for (const std::vector<double>& n : rows) {
    poses.push_back({.rotation_vector = {n.at(0), n.at(1), n.at(2)},
                     .pivot_mm = {n.at(3), n.at(4), n.at(5)},
                     .translation_mm = {n.at(6), n.at(7), n.at(8)},
                     .scale = n.at(9)});
  }
  return poses;
}

// Of these vertices of the mesh. Of others the columns would be compressed in another way.
absl::StatusOr<FloatPositions> Displacements(const PlanProblem& problem, DeformationModel model,
                                             const std::vector<int32_t>& vertices,
                                             const std::vector<HandlePose>& poses) {
  TF_ASSIGN_OR_RETURN(const auto preparation,
                      MeshPreparation::Create(*problem.mesh, problem.stiffness, problem.constraints,
                                              problem.deformer.preparation));
  TF_ASSIGN_OR_RETURN(const auto response, CreateResponse(preparation, vertices, {.model = model}));
  FloatPositions moves;
  response->Evaluate(poses, &moves);
  for (size_t v = 0; v < vertices.size(); ++v) {
    moves.row(static_cast<Eigen::Index>(v)) -=
        problem.mesh->positions().row(vertices[v]).cast<float>();
  }
  return moves;
}

absl::Status WritePositions(const std::string& plan, const std::string& model_name,
                            const std::string& poses, const std::string& out) {
  TF_ASSIGN_OR_RETURN(OpenedPlan opened, OpenPlan(plan, {}, ""));
  TF_ASSIGN_OR_RETURN(const DeformationModel model, ModelFromName(model_name));
  const std::vector<int32_t> vertices = FollowedVerticesOf(&opened.contents.surfaces);
  TF_ASSIGN_OR_RETURN(const FloatPositions moves,
                      Displacements(opened.problem, model, vertices, ReadPoses(poses)));
  std::ofstream file(out, std::ios::binary);
  for (const CaseSurface& surface : opened.contents.surfaces) {
    if (!surface.follows) continue;
    FloatPositions positions = surface.positions;
    for (Eigen::Index v = 0; v < positions.rows(); ++v) {
      for (int k = 0; k < 3; ++k) {
        positions.row(v) +=
            surface.follows->weights(v, k) * moves.row(surface.follows->vertices(v, k));
      }
    }
    file.write(reinterpret_cast<const char*>(positions.data()),
               static_cast<std::streamsize>(positions.size() * sizeof(float)));
  }
  return file.good() ? absl::OkStatus() : absl::UnavailableError("cannot write the positions");
}

}  // namespace
}  // namespace tissueform::testing

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  const absl::Status status =
      tissueform::testing::WritePositions(argv[1], argv[2], argv[3], argv[4]);
  if (!status.ok()) std::fprintf(stderr, "%s\n", std::string(status.message()).c_str());
  return status.ok() ? 0 : 1;
}
