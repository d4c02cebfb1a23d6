// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/plan_building/contact_trial.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/anatomy/osteotomy.h"
#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/deformation/arap_deformer.h"
#include "core/deformation/mesh_preparation.h"
#include "core/deformation/releasable_models.h"
#include "core/mesh/tet_quality.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {
namespace {

// The trial goes so much farther than the plan, so that the plan can still be dragged on from its
// pose: the demo moves the bundled jaw, planned by 6 mm, to 8.
constexpr double kOverreach = 4.0 / 3.0;
// Freeing corners may move the tear on to the next tets; every round but the last frees some
// vertex. Real heads take 4 to 13 rounds.
constexpr int kMaxRounds = 40;
// How far from a torn tet that nothing holds itself, in edges, what holds it is looked for. With
// three, a tet of the bundled head stayed torn in the as-rigid-as-possible model on two of three
// meshes.
constexpr int kMostRings = 6;

using TornTets = std::vector<bool>;  // #T

bool Any(const TornTets& torn) { return std::find(torn.begin(), torn.end(), true) != torn.end(); }

bool Moves(const HandlePose& pose) {
  return pose.rotation_vector.norm() > 0 || pose.translation_mm.norm() > 0 || pose.scale != 1;
}

std::vector<HandlePose> Overreaching(std::vector<HandlePose> poses) {
  for (HandlePose& pose : poses) pose = PartOfPose(pose, kOverreach);
  return poses;
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

// The models on trial, all but neo-Hookean, whose energy forbids inversion. The poses as planned
// are tried beside the farther ones: what a turn tears on its way need not be torn at its end.
class TriedModels {
 public:
  static absl::StatusOr<TriedModels> Create(const ContactTrial& trial) {
    Eigen::VectorXd stiffness = Eigen::Map<const Eigen::VectorXd>(
        trial.youngs_modulus_pa.data(), static_cast<Eigen::Index>(trial.youngs_modulus_pa.size()));
    TF_ASSIGN_OR_RETURN(auto quick, ReleasableModels::Create(trial.mesh, stiffness,
                                                             trial.poisson_ratio, trial.threads));
    return TriedModels(trial, std::move(stiffness), std::move(quick));
  }

  absl::StatusOr<TornTets> ByGradientField(const ConstraintSet& constraints) {
    return Torn(quick_->GradientField(constraints, pose_sets_));
  }
  absl::StatusOr<TornTets> ByLinearElastic(const ConstraintSet& constraints) {
    return Torn(quick_->LinearElastic(constraints, pose_sets_));
  }
  // The most dear: not asked for the poses as planned where the farther ones tear something.
  absl::StatusOr<TornTets> ByArap(const ConstraintSet& constraints) {
    PreparationOptions options;
    options.poisson_ratio = trial_->poisson_ratio;
    options.threads = trial_->threads;
    options.mesh_is_usable = true;
    TF_ASSIGN_OR_RETURN(
        const auto preparation,
        MeshPreparation::Create(trial_->mesh, stiffness_, constraints, std::move(options)));
    TF_ASSIGN_OR_RETURN(const auto deformer, CreateArapDeformer(preparation, {}));
    TornTets torn(static_cast<size_t>(trial_->mesh.num_tets()), false);
    for (const std::vector<HandlePose>& poses : pose_sets_) {
      TF_ASSIGN_OR_RETURN(const Deformation deformation, deformer->Deform(poses));
      Mark(deformation.positions, &torn);
      if (Any(torn)) break;
    }
    return torn;
  }

  // Two of them at once, where there are two threads: what any of both tears.
  using ByModel = absl::StatusOr<TornTets> (TriedModels::*)(const ConstraintSet&);
  absl::StatusOr<TornTets> ByBoth(ByModel first, ByModel second, const ConstraintSet& constraints) {
    const std::array<ByModel, 2> models = {first, second};
    std::array<absl::StatusOr<TornTets>, 2> torn;
    ParallelFor(trial_->threads, 2, 1, [&](Eigen::Index begin, Eigen::Index end) {
      for (Eigen::Index i = begin; i < end; ++i) torn[i] = (this->*models[i])(constraints);
    });
    for (const auto& part : torn) TF_RETURN_IF_ERROR(part.status());
    for (size_t t = 0; t < torn[1]->size(); ++t) {
      if ((*torn[1])[t]) (*torn[0])[t] = true;
    }
    return std::move(torn[0]);
  }

 private:
  TriedModels(const ContactTrial& trial, Eigen::VectorXd stiffness,
              std::unique_ptr<ReleasableModels> quick)
      : trial_(&trial),
        stiffness_(std::move(stiffness)),
        pose_sets_({Overreaching(trial.poses), trial.poses}),
        quick_(std::move(quick)) {}

  void Mark(const Positions& positions, TornTets* torn) const {
    const Eigen::VectorXd volumes = TetVolumes(positions, trial_->mesh.tets());
    for (Eigen::Index t = 0; t < volumes.size(); ++t) {
      if (volumes[t] <= 0) (*torn)[static_cast<size_t>(t)] = true;
    }
  }
  absl::StatusOr<TornTets> Torn(const absl::StatusOr<std::vector<Positions>>& answers) const {
    TF_RETURN_IF_ERROR(answers.status());
    TornTets torn(static_cast<size_t>(trial_->mesh.num_tets()), false);
    for (const Positions& positions : *answers) Mark(positions, &torn);
    return torn;
  }

  const ContactTrial* trial_;
  Eigen::VectorXd stiffness_;
  std::vector<std::vector<HandlePose>> pose_sets_;
  std::unique_ptr<ReleasableModels> quick_;
};

// Both models that answer at once in the first round: on one mesh of the bundled head the gradient
// field alone left edges there from which the tear ran on through twice as many vertices. On others
// the order made no such difference; none was best on all five heads that were tried. Then the
// gradient field until it tears nothing, because it costs least, and at last the others.
absl::StatusOr<TornTets> TornInRound(int round, const ConstraintSet& constraints,
                                     TriedModels* models) {
  if (round == 0) {
    return models->ByBoth(&TriedModels::ByLinearElastic, &TriedModels::ByGradientField,
                          constraints);
  }
  TF_ASSIGN_OR_RETURN(TornTets torn, models->ByGradientField(constraints));
  if (Any(torn)) return torn;
  return models->ByBoth(&TriedModels::ByLinearElastic, &TriedModels::ByArap, constraints);
}

// The constrained vertices within so many edges of a corner of a torn tet.
std::set<int32_t> HoldersOf(const TornTets& torn, int rings, const TetMesh& mesh,
                            const VertexCells& cells, const std::vector<uint8_t>& anatomy) {
  std::set<int32_t> reached;
  for (size_t t = 0; t < torn.size(); ++t) {
    const auto tet = mesh.tets().row(static_cast<Eigen::Index>(t));
    if (torn[t]) reached.insert(tet.begin(), tet.end());
  }
  for (int ring = 0; ring < rings; ++ring) {
    const std::set<int32_t> inner = reached;
    for (const int32_t v : inner) {
      for (Eigen::Index k = cells.begin(v); k < cells.end(v); ++k) {
        const auto tet = mesh.tets().row(cells.cell(k));
        reached.insert(tet.begin(), tet.end());
      }
    }
  }
  std::set<int32_t> holders;
  std::copy_if(reached.begin(), reached.end(), std::inserter(holders, holders.end()),
               [&](int32_t v) { return anatomy[static_cast<size_t>(v)] != 0; });
  return holders;
}

// Of the constrained corners of torn tets so few that each such tet loses one: those first that
// tear most tets. What holds must go on holding: with all corners freed, the bundled head's upper
// lip lost a quarter of what holds it to the maxilla, and the tear ran on along the teeth.
std::set<int32_t> FewestCorners(const TornTets& torn, const TetMesh& mesh, const VertexCells& cells,
                                const std::vector<uint8_t>& anatomy) {
  TornTets left = torn;
  std::set<int32_t> candidates = HoldersOf(torn, 0, mesh, cells, anatomy);
  const auto tears = [&](int32_t v) {
    int64_t count = 0;
    for (Eigen::Index k = cells.begin(v); k < cells.end(v); ++k) {
      count += left[static_cast<size_t>(cells.cell(k))] ? 1 : 0;
    }
    return count;
  };
  std::set<int32_t> corners;
  while (!candidates.empty()) {
    int32_t worst = *candidates.begin();
    for (const int32_t v : candidates) {
      if (tears(v) > tears(worst)) worst = v;
    }
    candidates.erase(worst);
    if (tears(worst) == 0) break;
    corners.insert(worst);
    for (Eigen::Index k = cells.begin(worst); k < cells.end(worst); ++k) {
      left[static_cast<size_t>(cells.cell(k))] = false;
    }
  }
  return corners;
}

// Where no torn tet has a constrained corner left, the nearest ones hold it.
std::set<int32_t> NearestHolders(const TornTets& torn, const TetMesh& mesh,
                                 const VertexCells& cells, const std::vector<uint8_t>& anatomy) {
  std::set<int32_t> holders = FewestCorners(torn, mesh, cells, anatomy);
  for (int rings = 1; rings <= kMostRings && holders.empty(); ++rings) {
    holders = HoldersOf(torn, rings, mesh, cells, anatomy);
  }
  return holders;
}

}  // namespace

absl::StatusOr<ReleasedContacts> ReleaseTornContacts(const ContactTrial& trial,
                                                     PlanningRegions regions) {
  ReleasedContacts released{.regions = std::move(regions)};
  if (std::none_of(trial.poses.begin(), trial.poses.end(), Moves)) return released;
  std::vector<uint8_t>& anatomy = released.regions.anatomy;
  const VertexCells cells(trial.mesh.tets(), trial.mesh.num_vertices());
  TF_ASSIGN_OR_RETURN(TriedModels models, TriedModels::Create(trial));
  for (int round = 0; round < kMaxRounds; ++round) {
    TF_ASSIGN_OR_RETURN(const ConstraintSet constraints, Constraints(trial, anatomy));
    TF_ASSIGN_OR_RETURN(const TornTets torn, TornInRound(round, constraints, &models));
    const std::set<int32_t> freed = NearestHolders(torn, trial.mesh, cells, anatomy);
    for (const int32_t v : freed) anatomy[static_cast<size_t>(v)] = 0;
    released.freed += static_cast<int64_t>(freed.size());
    released.still_torn = std::count(torn.begin(), torn.end(), true);
    if (freed.empty() && round > 0) break;
  }
  released.regions.freed_by_contact += released.freed;
  return released;
}

}  // namespace tissueform
