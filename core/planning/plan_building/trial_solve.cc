// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/trial_solve.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/types/span.h"

#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/mechanics/deformation/arap_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/deformation/releasable_models.h"
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
constexpr int kMaxRings = 6;

// Fewer vertices do not keep a piece from turning.
constexpr size_t kLeastHeld = 3;

using TornTets = std::vector<bool>;  // #T

bool Any(const TornTets& torn) { return std::find(torn.begin(), torn.end(), true) != torn.end(); }

bool Moves(const HandlePose& pose) {
  return pose.rotation_vector.norm() > 0 || pose.translation_mm.norm() > 0 || pose.scale != 1;
}

std::vector<HandlePose> Overreaching(std::vector<HandlePose> poses) {
  for (HandlePose& pose : poses) pose = PartOfPose(pose, kOverreach);
  return poses;
}

absl::StatusOr<ConstraintSet> Constraints(const TrialSolve& trial,
                                          const std::vector<uint8_t>& anatomy) {
  std::vector<std::vector<int32_t>> vertices(kFirstSegment + trial.poses.size());
  for (size_t v = 0; v < anatomy.size(); ++v) {
    vertices[anatomy[v]].push_back(static_cast<int32_t>(v));
  }
  if (std::any_of(vertices.begin() + kFixedBone, vertices.end(),
                  [](const auto& held) { return held.size() < kLeastHeld; })) {
    return absl::InvalidArgumentError(
        "the planned movements invert tets wherever bone is attached; plan smaller movements or "
        "use "
        "a wider \"contact_band_mm\"");
  }
  std::vector<HandleRegion> handles;
  for (size_t s = 0; s < trial.poses.size(); ++s) {
    handles.push_back({absl::StrCat("segment ", s), std::move(vertices[kFirstSegment + s])});
  }
  return ConstraintSet::Create(trial.mesh, std::move(vertices[kFixedBone]), std::move(handles));
}

// How far the gradient field is followed. It is steepest at the edge of what holds it, wherever the
// edge lies, so that beyond the planned pose its tear may run on with the edge: on one of five CTs
// of the same head, which differ by noise and faint streaks, it took the crowns of a canine and of
// all teeth behind it, and the corner of the mouth, which lies on them, went 3 mm farther with the
// jaw. There it ended in a tet that nothing holds; elsewhere it ends when enough is free.
enum class GradientField { kAsTheOthers, kAsPlanned };

// The models on trial, all but neo-Hookean, whose energy forbids inversion. The poses as planned
// are tried beside the farther ones: what a turn tears on its way need not be torn at its end.
class TriedModels {
 public:
  static absl::StatusOr<TriedModels> Create(const TrialSolve& trial, GradientField followed) {
    Eigen::VectorXd stiffness = Eigen::Map<const Eigen::VectorXd>(
        trial.youngs_modulus_pa.data(), static_cast<Eigen::Index>(trial.youngs_modulus_pa.size()));
    TF_ASSIGN_OR_RETURN(auto quick, ReleasableModels::Create(trial.mesh, stiffness,
                                                             trial.poisson_ratio, trial.threads));
    return TriedModels(trial, followed, std::move(stiffness), std::move(quick));
  }

  absl::StatusOr<TornTets> ByGradientField(const ConstraintSet& constraints) {
    const bool as_planned = followed_ == GradientField::kAsPlanned;
    return Torn(quick_->GradientField(
        constraints, absl::MakeSpan(pose_sets_).subspan(as_planned ? pose_sets_.size() - 1 : 0)));
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
    options.node_order = node_order_;
    TF_ASSIGN_OR_RETURN(
        const auto preparation,
        MeshPreparation::Create(trial_->mesh, stiffness_, constraints, std::move(options)));
    TF_ASSIGN_OR_RETURN(const auto deformer, CreateArapDeformer(preparation, {}));
    TornTets torn(static_cast<size_t>(trial_->mesh.num_tets()), false);
    node_order_ = preparation->node_order();
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
  TriedModels(const TrialSolve& trial, GradientField followed, Eigen::VectorXd stiffness,
              std::unique_ptr<ReleasableModels> quick)
      : trial_(&trial),
        followed_(followed),
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

  const TrialSolve* trial_;
  GradientField followed_;
  Eigen::VectorXd stiffness_;
  std::vector<std::vector<HandlePose>> pose_sets_;
  std::unique_ptr<ReleasableModels> quick_;
  // Of the last mesh preparation, so that only the first looks for one.
  std::vector<int32_t> node_order_;
};

// Both models that answer at once in the first round: on one mesh of the bundled head the gradient
// field alone left edges there from which the tear ran on through twice as many vertices. On others
// the order made no such difference; none was best on all five heads that were tried. Then the
// gradient field until it tears nothing, because it costs least, and at last the others.
struct TornInRound {
  TornTets tets;
  bool by_gradient_field_alone = false;
};

absl::StatusOr<TornInRound> Try(int round, const ConstraintSet& constraints, TriedModels* models) {
  TornInRound torn;
  if (round == 0) {
    TF_ASSIGN_OR_RETURN(torn.tets, models->ByBoth(&TriedModels::ByLinearElastic,
                                                  &TriedModels::ByGradientField, constraints));
    return torn;
  }
  TF_ASSIGN_OR_RETURN(torn.tets, models->ByGradientField(constraints));
  torn.by_gradient_field_alone = Any(torn.tets);
  if (torn.by_gradient_field_alone) return torn;
  TF_ASSIGN_OR_RETURN(
      torn.tets, models->ByBoth(&TriedModels::ByLinearElastic, &TriedModels::ByArap, constraints));
  return torn;
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
  std::set<int32_t> holders;
  for (int rings = 1; rings <= kMaxRings && holders.empty(); ++rings) {
    holders = HoldersOf(torn, rings, mesh, cells, anatomy);
  }
  return holders;
}

// Nothing, when the gradient field has run on beyond the planned pose.
absl::StatusOr<std::optional<ContactRelaxation>> Release(const TrialSolve& trial,
                                                         const VertexCells& cells,
                                                         GradientField followed,
                                                         PlanningRegions regions) {
  ContactRelaxation released{.regions = std::move(regions)};
  std::vector<uint8_t>& anatomy = released.regions.anatomy;
  TF_ASSIGN_OR_RETURN(TriedModels models, TriedModels::Create(trial, followed));
  for (int round = 0; round < kMaxRounds; ++round) {
    TF_ASSIGN_OR_RETURN(const ConstraintSet constraints, Constraints(trial, anatomy));
    TF_ASSIGN_OR_RETURN(const TornInRound torn, Try(round, constraints, &models));
    std::set<int32_t> freed = FewestCorners(torn.tets, trial.mesh, cells, anatomy);
    if (followed == GradientField::kAsTheOthers && torn.by_gradient_field_alone && freed.empty()) {
      return std::nullopt;
    }
    if (freed.empty()) freed = NearestHolders(torn.tets, trial.mesh, cells, anatomy);
    for (const int32_t v : freed) anatomy[static_cast<size_t>(v)] = 0;
    released.freed += static_cast<int64_t>(freed.size());
    released.num_inverted = std::count(torn.tets.begin(), torn.tets.end(), true);
    if (freed.empty() && round > 0) break;
  }
  released.regions.freed_by_contact += released.freed;
  return released;
}

}  // namespace

absl::StatusOr<ContactRelaxation> ReleaseTornContacts(const TrialSolve& trial,
                                                      PlanningRegions regions) {
  if (std::none_of(trial.poses.begin(), trial.poses.end(), Moves)) {
    return ContactRelaxation{.regions = std::move(regions)};
  }
  const VertexCells cells(trial.mesh.tets(), trial.mesh.num_vertices());
  TF_ASSIGN_OR_RETURN(std::optional<ContactRelaxation> released,
                      Release(trial, cells, GradientField::kAsTheOthers, regions));
  if (!released) {
    TF_ASSIGN_OR_RETURN(released,
                        Release(trial, cells, GradientField::kAsPlanned, std::move(regions)));
  }
  return *std::move(released);
}

}  // namespace tissueform
