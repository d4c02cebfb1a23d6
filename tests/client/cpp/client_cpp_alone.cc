// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// A program that links client/cpp and nothing else: tests/scripts/check_file_library_links.sh looks
// at what came with it. Opens a drag of a plan that was not read from files.
//
//   client-cpp-alone HOST:PORT

#include "client/cpp/plan_session.h"
#include "core/base/status_macros.h"
#include "core/mesh/bar_mesh.h"

namespace tissueform {
namespace {

absl::StatusOr<PlanProblem> BarProblem() {
  TF_ASSIGN_OR_RETURN(TetMesh bar, BarMesh(CubeGrid({1, 1, 2}, 1)));
  TF_ASSIGN_OR_RETURN(ConstraintSet ends,
                      ConstraintSet::Create(bar, {0, 1, 2, 3}, {{"top", {8, 9, 10, 11}}}));
  const Eigen::Index num_tets = bar.num_tets();
  return PlanProblem{.mesh = std::make_shared<const TetMesh>(std::move(bar)),
                     .point_data = {},
                     .cell_data = {},
                     .written_in = CoordinateSystem::kLps,
                     .stiffness = Eigen::VectorXd::Constant(num_tets, 15e3),
                     .constraints = std::move(ends),
                     .poses = {{.translation_mm = {0, -1, 0}}},
                     .deformer = {},
                     .uncertainty = {}};
}

absl::Status Drag(const std::string& address) {
  TF_ASSIGN_OR_RETURN(const auto client, TissueformClient::Connect(address, {}));
  TF_ASSIGN_OR_RETURN(const PlanProblem problem, BarProblem());
  TF_ASSIGN_OR_RETURN(const auto session, PlanSession::Create(client.get(), problem));
  TF_ASSIGN_OR_RETURN(const auto stream, client->OpenStream(session->name(), {}));
  TF_RETURN_IF_ERROR(stream->SendPoses(1, NamedPoses(problem)));
  stream->CloseSending();
  return stream->Finish();
}

}  // namespace
}  // namespace tissueform

int main(int argc, char** argv) { return argc == 2 && tissueform::Drag(argv[1]).ok() ? 0 : 1; }
