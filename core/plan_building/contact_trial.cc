// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/plan_building/contact_trial.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/anatomy/osteotomy.h"
#include "core/base/status_macros.h"
#include "core/deformation/create_deformer.h"
#include "core/mesh/tet_quality.h"

namespace tissueform {
namespace {

// The trial goes so much farther than the plan, so that the plan can still be dragged on from its
// pose: the demo moves the bundled jaw, planned by 6 mm, to 8.
constexpr double kOverreach = 4.0 / 3.0;
// Freeing corners may move the tear on to the next tets; every round but the last frees some
// vertex.
constexpr int kMaxRounds = 20;

std::vector<HandlePose> Overreaching(std::vector<HandlePose> poses) {
  for (HandlePose& pose : poses) pose = PartOfPose(pose, kOverreach);
  return poses;
}

bool Moves(const HandlePose& pose) {
  return pose.rotation_vector.norm() > 0 || pose.translation_mm.norm() > 0 || pose.scale != 1;
}

absl::StatusOr<ConstraintSet> Constraints(const ContactTrial& trial,
                                          const std::vector<uint8_t>& anatomy) {
  std::vector<std::vector<int32_t>> vertices(kFirstSegment + trial.poses.size());
  for (size_t v = 0; v < anatomy.size(); ++v) {
    vertices[anatomy[v]].push_back(static_cast<int32_t>(v));
  }
  std::vector<HandleRegion> handles;
  for (size_t s = 0; s < trial.poses.size(); ++s) {
    handles.push_back({absl::StrCat("segment ", s), std::move(vertices[kFirstSegment + s])});
  }
  if (vertices[kFixedBone].empty() ||
      std::any_of(handles.begin(), handles.end(),
                  [](const HandleRegion& handle) { return handle.vertices.empty(); })) {
    return absl::InvalidArgumentError(
        "the planned moves tear the tissue wherever the bones are held; plan smaller moves or give "
        "a wider \"contact_band_mm\"");
  }
  return ConstraintSet::Create(trial.mesh, std::move(vertices[kFixedBone]), std::move(handles));
}

// The tets that a model turns inside out. The two models that answer without iterating stand for
// all: the gradient field tears where rotations and gaps disagree, linear elasticity where strain
// is large. arap and neo-Hookean cost tens of solves a pose, and the energy of the latter forbids
// inversion.
absl::Status FindTorn(const ContactTrial& trial,
                      const std::shared_ptr<MeshPreparation>& preparation, DeformationModel model,
                      std::vector<bool>* torn) {
  DeformerOptions options;
  options.model = model;
  TF_ASSIGN_OR_RETURN(const auto deformer, CreateDeformer(preparation, options));
  TF_ASSIGN_OR_RETURN(const Deformation deformation, deformer->Deform(Overreaching(trial.poses)));
  const Eigen::VectorXd volumes = TetVolumes(deformation.positions, trial.mesh.tets());
  for (Eigen::Index t = 0; t < volumes.size(); ++t) {
    if (volumes[t] <= 0) (*torn)[static_cast<size_t>(t)] = true;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<bool>> TornTets(const ContactTrial& trial,
                                           const std::vector<uint8_t>& anatomy) {
  TF_ASSIGN_OR_RETURN(const ConstraintSet constraints, Constraints(trial, anatomy));
  PreparationOptions options;
  options.poisson_ratio = trial.poisson_ratio;
  options.threads = trial.threads;
  TF_ASSIGN_OR_RETURN(
      const auto preparation,
      MeshPreparation::Create(trial.mesh,
                              Eigen::Map<const Eigen::VectorXd>(
                                  trial.youngs_modulus_pa.data(),
                                  static_cast<Eigen::Index>(trial.youngs_modulus_pa.size())),
                              constraints, std::move(options)));
  std::vector<bool> torn(static_cast<size_t>(trial.mesh.num_tets()), false);
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kLinearElastic}) {
    TF_RETURN_IF_ERROR(FindTorn(trial, preparation, model, &torn));
  }
  return torn;
}

// Only the corners of torn tets are freed, not their neighbours: what holds must go on holding.
std::set<int32_t> CornersOf(const TetMesh& mesh, const std::vector<bool>& torn) {
  std::set<int32_t> corners;
  for (size_t t = 0; t < torn.size(); ++t) {
    if (!torn[t]) continue;
    const auto tet = mesh.tets().row(static_cast<Eigen::Index>(t));
    corners.insert(tet.begin(), tet.end());
  }
  return corners;
}

}  // namespace

absl::StatusOr<ReleasedContacts> ReleaseTornContacts(const ContactTrial& trial,
                                                     PlanningRegions regions) {
  ReleasedContacts released{.regions = std::move(regions), .freed = 0};
  if (std::none_of(trial.poses.begin(), trial.poses.end(), Moves)) return released;
  for (int round = 0; round < kMaxRounds; ++round) {
    TF_ASSIGN_OR_RETURN(const std::vector<bool> torn, TornTets(trial, released.regions.anatomy));
    int64_t now = 0;
    for (const int32_t v : CornersOf(trial.mesh, torn)) {
      uint8_t& held_by = released.regions.anatomy[static_cast<size_t>(v)];
      now += held_by != 0 ? 1 : 0;
      held_by = 0;
    }
    if (now == 0) break;
    released.freed += now;
  }
  released.regions.freed_by_contact += released.freed;
  return released;
}

}  // namespace tissueform
