// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/material_expansion.h"

#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/elasticity/elastic_stiffness.h"
#include "core/mechanics/elasticity/neo_hookean_energy.h"
#include "core/mechanics/elasticity/neo_hookean_tangent.h"
#include "core/mechanics/linear_solvers/dirichlet_system.h"
#include "core/mechanics/uncertainty/held_contact.h"

namespace tissueform {
namespace {

// Of the material at the state that is expanded, for any stiffness (zeros too) and Poisson's ratio.
struct LawAtState {
  std::function<SparseMatrix(const Eigen::VectorXd& stiffness, double poisson_ratio)> tangent;
  // 3 #V by #columns, what holds the state
  std::function<Eigen::MatrixXd(const Eigen::VectorXd& stiffness, double poisson_ratio)> forces;
};

// The three unknowns of every constrained vertex, rising.
std::vector<int32_t> ConstrainedUnknowns(const ConstraintSet& constraints) {
  std::vector<int32_t> unknowns;
  for (const int32_t vertex : constraints.constrained()) {
    for (int axis = 0; axis < 3; ++axis) unknowns.push_back(3 * vertex + axis);
  }
  return unknowns;
}

class Expander {
 public:
  Expander(const MeshPreparation& preparation, const MaterialUncertainty& uncertainty,
           LawAtState law, ExpansionOrder order, const Cancellation& cancellation,
           const SparseMatrix* held)
      : preparation_(preparation),
        uncertainty_(uncertainty),
        law_(std::move(law)),
        order_(order),
        cancellation_(cancellation) {
    if (held != nullptr) held_ = *held;
  }

  // With a factor of its own.
  absl::StatusOr<AnswerExpansion> ExpandOwn() {
    TF_ASSIGN_OR_RETURN(const auto system, Factorise(poisson_ratio()));
    return Expand(*system);
  }

  absl::StatusOr<AnswerExpansion> Expand(const DirichletSystem& system) {
    TF_ASSIGN_OR_RETURN(const HeldResponse response, HeldIn(system));
    TF_RETURN_IF_ERROR(ExpandTissues(response));
    if (order_ == ExpansionOrder::kSecond) TF_RETURN_IF_ERROR(ExpandPairs(response));
    if (uncertainty_.poisson_ratio_95) TF_RETURN_IF_ERROR(ExpandPoissonRatio());
    return std::move(expansion_);
  }

 private:
  double Sigma(int tissue) const {
    return std::log(uncertainty_.tissues[static_cast<size_t>(tissue)].factor_95) / kNormal95;
  }

  Eigen::VectorXd StiffnessOf(int tissue) const {
    Eigen::VectorXd stiffness = preparation_.stiffness();
    for (Eigen::Index t = 0; t < stiffness.size(); ++t) {
      if (uncertainty_.tissue_of_tet[static_cast<size_t>(t)] != tissue) stiffness[t] = 0;
    }
    return stiffness;
  }

  absl::StatusOr<std::unique_ptr<DirichletSystem>> Factorise(double poisson_ratio) const {
    return DirichletSystem::Create(law_.tangent(preparation_.stiffness(), poisson_ratio),
                                   ConstrainedUnknowns(preparation_.constraints()),
                                   {.backend = preparation_.options().backend,
                                    .admission = preparation_.options().admission,
                                    .unknowns_per_node = 3,
                                    .node_order = preparation_.node_order()},
                                   cancellation_);
  }

  double poisson_ratio() const { return preparation_.options().poisson_ratio; }

  absl::StatusOr<HeldResponse> HeldIn(const DirichletSystem& system) const {
    return HeldResponse::Create(system, held_, cancellation_);
  }

  absl::Status ExpandTissues(const HeldResponse& response) {
    const auto tissues = static_cast<int>(uncertainty_.tissues.size());
    expansion_.variables = tissues;
    for (int i = 0; i < tissues; ++i) {
      TF_RETURN_IF_ERROR(cancellation_.Check());
      const Eigen::VectorXd stiffness = StiffnessOf(i);
      forces_.push_back(Sigma(i) * law_.forces(stiffness, poisson_ratio()));
      TF_ASSIGN_OR_RETURN(Eigen::MatrixXd field, response.Respond(-forces_.back()));
      expansion_.terms.push_back({.first = i, .field = std::move(field)});
      if (order_ == ExpansionOrder::kSecond) {
        // Most entries of one tissue's matrix are zeros of the others.
        SparseMatrix tangent = Sigma(i) * law_.tangent(stiffness, poisson_ratio());
        tangents_.push_back(tangent.pruned());
      }
    }
    return absl::OkStatus();
  }

  absl::Status ExpandPairs(const HeldResponse& response) {
    const int tissues = expansion_.variables;
    for (int i = 0; i < tissues; ++i) {
      const auto row = static_cast<size_t>(i);
      for (int j = i; j < tissues; ++j) {
        TF_RETURN_IF_ERROR(cancellation_.Check());
        const auto column = static_cast<size_t>(j);
        Eigen::MatrixXd forces = tangents_[row] * expansion_.terms[column].field;
        if (i == j) {
          forces += 0.5 * Sigma(i) * forces_[row];
        } else {
          forces += tangents_[column] * expansion_.terms[row].field;
        }
        TF_ASSIGN_OR_RETURN(Eigen::MatrixXd field, response.Respond(-forces));
        expansion_.terms.push_back({.first = i, .second = j, .field = std::move(field)});
      }
    }
    return absl::OkStatus();
  }

  // The move to the equilibrium with another ratio: a Newton step, which is all of it where the
  // forces are linear.
  absl::StatusOr<Eigen::MatrixXd> MoveTo(double poisson_ratio) const {
    TF_RETURN_IF_ERROR(cancellation_.Check());
    TF_ASSIGN_OR_RETURN(const auto system, Factorise(poisson_ratio));
    TF_ASSIGN_OR_RETURN(const HeldResponse response, HeldIn(*system));
    return response.Respond(-law_.forces(preparation_.stiffness(), poisson_ratio));
  }

  absl::Status ExpandPoissonRatio() {
    const int variable = expansion_.variables++;
    TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd lowest, MoveTo((*uncertainty_.poisson_ratio_95)[0]));
    TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd highest, MoveTo((*uncertainty_.poisson_ratio_95)[1]));
    expansion_.terms.push_back({.first = variable, .field = (highest - lowest) / (2 * kNormal95)});
    if (order_ == ExpansionOrder::kSecond) {
      expansion_.terms.push_back({.first = variable,
                                  .second = variable,
                                  .field = (highest + lowest) / (2 * kNormal95 * kNormal95)});
    }
    return absl::OkStatus();
  }

  const MeshPreparation& preparation_;
  const MaterialUncertainty& uncertainty_;
  const LawAtState law_;
  const ExpansionOrder order_;
  const Cancellation& cancellation_;
  SparseMatrix held_;  // without columns where there is no contact

  std::vector<Eigen::MatrixXd> forces_;  // of each tissue, times its sigma
  std::vector<SparseMatrix> tangents_;   // likewise
  AnswerExpansion expansion_;
};

// What holds an answer with contact has to be said.
absl::Status CheckHeld(const MeshPreparation& preparation, const SparseMatrix* held) {
  if (held != nullptr) return absl::OkStatus();
  return CheckWithoutContact(preparation.constraints(), "the band of uncertainty");
}

}  // namespace

absl::StatusOr<AnswerExpansion> ExpandLinearElastic(MeshPreparation* preparation,
                                                    const MaterialUncertainty& uncertainty,
                                                    const Eigen::MatrixXd& displacements,
                                                    ExpansionOrder order,
                                                    const Cancellation& cancellation,
                                                    const SparseMatrix* held) {
  TF_RETURN_IF_ERROR(CheckHeld(*preparation, held));
  LawAtState law;
  law.tangent = [preparation](const Eigen::VectorXd& stiffness, double poisson_ratio) {
    return ElasticStiffness(preparation->elements(), preparation->vertex_cells(), stiffness,
                            poisson_ratio, preparation->options().threads);
  };
  law.forces = [&](const Eigen::VectorXd& stiffness, double poisson_ratio) {
    return Eigen::MatrixXd(law.tangent(stiffness, poisson_ratio) * displacements);
  };
  Expander expander(*preparation, uncertainty, law, order, cancellation, held);
  if (held == nullptr) {
    TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic(cancellation));
    return expander.Expand(elastic->system());
  }
  // The unknowns of the preparation's own factor are turned where tissue slides.
  return expander.ExpandOwn();
}

absl::StatusOr<AnswerExpansion> ExpandNeoHookean(MeshPreparation* preparation,
                                                 const MaterialUncertainty& uncertainty,
                                                 const Positions& deformed, ExpansionOrder order,
                                                 const Cancellation& cancellation,
                                                 const SparseMatrix* held) {
  TF_RETURN_IF_ERROR(CheckHeld(*preparation, held));
  const Positions displacements = deformed - preparation->mesh().positions();
  const int threads = preparation->options().threads;
  LawAtState law;
  law.tangent = [&](const Eigen::VectorXd& stiffness, double poisson_ratio) {
    return NeoHookeanTangent(preparation->elements(), preparation->vertex_cells(), stiffness,
                             poisson_ratio, displacements, TangentForm::kTrue, threads);
  };
  law.forces = [&](const Eigen::VectorXd& stiffness, double poisson_ratio) {
    NeoHookeanEnergy energy(preparation->elements(), preparation->vertex_cells(), stiffness,
                            poisson_ratio, threads);
    Positions gradient = Positions::Zero(displacements.rows(), 3);
    energy.Evaluate(displacements, &gradient);
    return Eigen::MatrixXd(Eigen::Map<const Eigen::VectorXd>(gradient.data(), gradient.size()));
  };
  Expander expander(*preparation, uncertainty, law, order, cancellation, held);
  absl::StatusOr<AnswerExpansion> expansion = expander.ExpandOwn();
  if (absl::IsFailedPrecondition(expansion.status())) {
    return absl::FailedPreconditionError(
        "the tangent stiffness of neo_hookean is not positive definite at this answer, so its "
        "95 % interval is not known; linear_elastic has one");
  }
  return expansion;
}

absl::StatusOr<AnswerExpansion> ExpandAnswer(MeshPreparation* preparation, DeformationModel model,
                                             const MaterialUncertainty& uncertainty,
                                             absl::Span<const HandlePose> poses,
                                             const Positions& deformed, ExpansionOrder order,
                                             const Cancellation& cancellation) {
  if (!TraitsOf(model).is_elastic) {
    return absl::InvalidArgumentError(
        "the band of uncertainty needs linear_elastic or neo_hookean; choose one of them");
  }
  const bool is_nonlinear = model == DeformationModel::kNeoHookean;
  const Positions& rest = preparation->mesh().positions();
  const ConstraintSet& constraints = preparation->constraints();
  const SparseMatrix held = HeldDirections(constraints, rest, poses, deformed, is_nonlinear);
  const SparseMatrix* with_contact = constraints.contact().empty() ? nullptr : &held;
  if (is_nonlinear) {
    return ExpandNeoHookean(preparation, uncertainty, deformed, order, cancellation, with_contact);
  }
  const Positions displacements = deformed - rest;
  return ExpandLinearElastic(
      preparation, uncertainty,
      Eigen::Map<const Eigen::VectorXd>(displacements.data(), displacements.size()), order,
      cancellation, with_contact);
}

}  // namespace tissueform
