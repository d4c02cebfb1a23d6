// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/deformation/gradient_field_deformer.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/deformation/anderson_acceleration.h"
#include "core/deformation/harmonic_fields.h"
#include "core/deformation/poisson_reconstruction.h"
#include "core/deformation/rotation_propagation.h"
#include "core/mesh/tet_quality.h"
#include "core/mesh/validation.h"
#include "core/operators/edge_laplacian.h"
#include "core/operators/laplacian.h"
#include "core/operators/piecewise_linear_elements.h"

namespace tissueform {
namespace {

absl::Status CheckPoses(const ConstraintSet& constraints, absl::Span<const HandlePose> poses) {
  if (poses.size() != constraints.handles().size()) {
    return absl::InvalidArgumentError(absl::StrCat("got ", poses.size(), " poses for ",
                                                   constraints.handles().size(),
                                                   " handles; give one pose for each handle"));
  }
  for (size_t h = 0; h < poses.size(); ++h) {
    if (const absl::Status status = CheckPose(poses[h]); !status.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("handle \"", constraints.handles()[h].name, "\": ", status.message()));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckOptions(const GradientFieldOptions& options) {
  if (options.max_iterations < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_iterations is ", options.max_iterations, "; it must be at least 1"));
  }
  if (!std::isfinite(options.tolerance_mm) || options.tolerance_mm <= 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("tolerance_mm is ", options.tolerance_mm, "; it must be a positive number"));
  }
  return absl::OkStatus();
}

absl::Status CheckStiffness(Eigen::Index num_cells, const Eigen::VectorXd& stiffness,
                            absl::string_view cell_name) {
  if (stiffness.size() != num_cells) {
    return absl::InvalidArgumentError(absl::StrCat("stiffness has ", stiffness.size(),
                                                   " values for ", num_cells, " ", cell_name,
                                                   "s; give one for each ", cell_name));
  }
  for (Eigen::Index c = 0; c < stiffness.size(); ++c) {
    if (!std::isfinite(stiffness[c]) || stiffness[c] <= 0) {
      return absl::InvalidArgumentError(absl::StrCat("stiffness of ", cell_name, " ", c, " is ",
                                                     stiffness[c],
                                                     " Pa; it must be a positive number"));
    }
  }
  return absl::OkStatus();
}

// Once they are in the weights of the cells nothing needs them.
PiecewiseLinearElements WithoutMeasures(PiecewiseLinearElements elements) {
  elements.measures.resize(0);
  return elements;
}

class GradientFieldDeformer : public Deformer {
 public:
  GradientFieldDeformer(PiecewiseLinearElements elements, const Eigen::VectorXd& stiffness,
                        ConstraintSet constraints, GradientFieldOptions options)
      : cell_weights_(stiffness.cwiseProduct(elements.measures)),
        elements_(WithoutMeasures(std::move(elements))),
        vertex_cells_(elements_.cells, elements_.num_vertices()),
        constraints_(std::move(constraints)),
        options_(std::move(options)) {}

  absl::Status Prepare(const SparseMatrix& L, double assemble_seconds) {
    preparation_.assemble_seconds = assemble_seconds;
    preparation_.negative_weights = CountNegativeWeights(L);
    TF_ASSIGN_OR_RETURN(laplacian_,
                        DirichletSystem::Create(L, constraints_.constrained(),
                                                {options_.backend, options_.admission}));
    AddFactorization(laplacian_->factorization());
    TF_RETURN_IF_ERROR(PrepareHarmonicFields());
    preparation_.bytes_held = laplacian_->bytes_held() + vertex_cells_.bytes_held() +
                              DoublesHeld() * static_cast<int64_t>(sizeof(double));
    return absl::OkStatus();
  }

  absl::StatusOr<Deformation> Deform(absl::Span<const HandlePose> poses,
                                     const DeformControl& control) override {
    TF_RETURN_IF_ERROR(CheckPoses(constraints_, poses));
    const Stopwatch stopwatch;
    const Target target = MakeTarget(poses);
    if (options_.rotation != RotationMode::kNone) {
      PropagateRotations(harmonic_, poses, options_.threads, &propagated_);
    }
    if (options_.rotation == RotationMode::kEstimated) {
      return Iterate(target, control, stopwatch);
    }
    TransformsToCornerLoads(elements_, cell_weights_, options_.threads, &propagated_);
    TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd displacements, Reconstruct(propagated_, target));
    Deformation deformation;
    deformation.positions = ToPositions(displacements, target);
    deformation.summary.solve_seconds = stopwatch.Seconds();
    deformation.summary.residual = last_residual_;
    return deformation;
  }

  const PreparationSummary& preparation() const override { return preparation_; }

 private:
  // Where the constrained vertices go, #constrained by 3.
  struct Target {
    Positions positions;
    Positions displacements;
  };

  void AddFactorization(const FactorizationSummary& factorization) {
    preparation_.analyse_seconds += factorization.analyse_seconds;
    preparation_.factorise_seconds += factorization.factorise_seconds;
    preparation_.factor_bytes += factorization.factor_bytes;
  }

  int64_t DoublesHeld() const {
    return elements_.normals.size() + cell_weights_.size() + harmonic_.size() +
           blend_weights_.size() + TransformDoubles();
  }

  // What the transforms of poses will hold, at most.
  Eigen::Index TransformDoubles() const {
    int kinds = options_.rotation == RotationMode::kNone ? 0 : 1;
    if (options_.rotation == RotationMode::kEstimated) {
      ++kinds;  // estimated ones beside propagated ones
    }
    return kinds * CellTransforms::ColsAtCompileTime * elements_.num_cells();
  }

  absl::Status PrepareHarmonicFields() {
    Stopwatch stopwatch;
    Eigen::MatrixXd fields;
    if (options_.guidance == Guidance::kCotangent) {
      TF_ASSIGN_OR_RETURN(fields, ComputeHarmonicFields(constraints_, laplacian_.get()));
    } else {
      // Its factor is given back as soon as the fields are known.
      TF_ASSIGN_OR_RETURN(
          const auto uniform,
          DirichletSystem::Create(
              UniformLaplacian(elements_.cells, elements_.num_vertices(), options_.threads),
              constraints_.constrained(), {options_.backend, options_.admission}));
      TF_ASSIGN_OR_RETURN(fields, ComputeHarmonicFields(constraints_, uniform.get()));
    }
    preparation_.harmonic_min = fields.minCoeff();
    preparation_.harmonic_max = fields.maxCoeff();
    harmonic_ = SampleAtBarycentres(elements_.cells, fields);
    if (options_.rotation == RotationMode::kEstimated) {
      blend_weights_ = BlendWeights(harmonic_, options_.blend);
    }
    preparation_.prepare_seconds = stopwatch.Seconds();
    return absl::OkStatus();
  }

  Target MakeTarget(absl::Span<const HandlePose> poses) const {
    const std::vector<int32_t>& vertices = constraints_.constrained();
    std::vector<Eigen::Matrix3d> linear_parts;
    for (const HandlePose& pose : poses) {
      linear_parts.push_back(pose.scale * RotationMatrix(pose.rotation_vector));
    }
    Target target{elements_.rest(vertices, Eigen::all), {}};
    for (Eigen::Index c = 0; c < target.positions.rows(); ++c) {
      const int handle = constraints_.region_of_constrained()[c];
      if (handle != ConstraintSet::kFixed) {
        const HandlePose& pose = poses[handle];
        const Eigen::Vector3d position = target.positions.row(c);
        target.positions.row(c) =
            pose.pivot_mm + linear_parts[handle] * (position - pose.pivot_mm) + pose.translation_mm;
      }
    }
    target.displacements = target.positions - elements_.rest(vertices, Eigen::all);
    return target;
  }

  // One linear solve: displacements, #V by 3, under the loads of turned cells (empty: not turned).
  absl::StatusOr<Eigen::MatrixXd> Reconstruct(const CornerLoads& loads, const Target& target) {
    const Eigen::MatrixXd rhs =
        GatherCornerLoads(vertex_cells_, elements_.num_vertices(), loads, options_.threads);
    TF_ASSIGN_OR_RETURN(Eigen::MatrixXd displacements,
                        laplacian_->Solve(rhs, target.displacements));
    if (options_.compute_residual) {
      last_residual_ = laplacian_->RelativeResidual(rhs, displacements);
    }
    return displacements;
  }

  Positions ToPositions(const Eigen::MatrixXd& displacements, const Target& target) const {
    Positions positions = elements_.rest + displacements;
    // Exactly where the pose puts them, not up to the rounding of adding and taking away.
    positions(constraints_.constrained(), Eigen::all) = target.positions;
    return positions;
  }

  // Fixed-point iteration of the `estimated` mode: estimate rotations, blend, reconstruct.
  absl::StatusOr<Deformation> Iterate(const Target& target, const DeformControl& control,
                                      const Stopwatch& stopwatch) {
    if (!control.warm_start || last_loads_.rows() == 0) {
      last_loads_ = propagated_;
      TransformsToCornerLoads(elements_, cell_weights_, options_.threads, &last_loads_);
    }
    AndersonAcceleration acceleration(options_.acceleration_depth);
    TF_ASSIGN_OR_RETURN(Eigen::MatrixXd iterate, Reconstruct(last_loads_, target));
    Deformation deformation;
    SolveSummary& summary = deformation.summary;
    summary.converged = false;
    // Positions are made only where somebody sees them.
    const auto report = [&](const Eigen::MatrixXd& displacements) {
      summary.solve_seconds = stopwatch.Seconds();
      summary.residual = last_residual_;
      const bool last = summary.converged || summary.iterations >= options_.max_iterations;
      if (last || control.on_progress) {
        deformation.positions = ToPositions(displacements, target);
      }
      summary.cancelled = !last && control.on_progress && !control.on_progress(deformation);
    };
    report(iterate);
    while (!summary.converged && !summary.cancelled &&
           summary.iterations < options_.max_iterations) {
      EstimateRotations(elements_, elements_.rest + iterate, blend_weights_, propagated_,
                        options_.threads, &last_loads_);
      TransformsToCornerLoads(elements_, cell_weights_, options_.threads, &last_loads_);
      TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd image, Reconstruct(last_loads_, target));
      ++summary.iterations;
      summary.changes_mm.push_back((image - iterate).rowwise().norm().maxCoeff());
      summary.converged = summary.changes_mm.back() <= options_.tolerance_mm;
      report(image);
      iterate = acceleration.Next(iterate, image);
    }
    return deformation;
  }

  // Constant after Prepare.
  const Eigen::VectorXd cell_weights_;  // stiffness times volume or area
  const PiecewiseLinearElements elements_;
  const VertexCells vertex_cells_;
  const ConstraintSet constraints_;
  const GradientFieldOptions options_;
  CellField harmonic_;             // #C by #handles
  Eigen::VectorXd blend_weights_;  // #C; empty unless rotations are estimated
  PreparationSummary preparation_;

  // Holds workspaces.
  std::unique_ptr<DirichletSystem> laplacian_;
  double last_residual_ = 0;
  // Of the last poses; their loads once a mode that does not iterate has them. No rows in mode
  // kNone.
  CellTransforms propagated_;
  // Those of the last answer's estimated transforms, from which a warm start goes on; empty before
  // the first.
  CornerLoads last_loads_;
};

absl::Status CheckAreas(const PiecewiseLinearElements& elements) {
  for (Eigen::Index f = 0; f < elements.measures.size(); ++f) {
    if (!std::isfinite(elements.measures[f]) || elements.measures[f] <= 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("triangle ", f, " has no area; remove it or remesh the surface"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<Deformer>> CreateGradientFieldDeformer(
    const TetMesh& mesh, const Eigen::VectorXd& stiffness, const ConstraintSet& constraints,
    const GradientFieldOptions& options) {
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_RETURN_IF_ERROR(CheckUsable(ValidateTetMesh(mesh)));
  TF_RETURN_IF_ERROR(CheckStiffness(mesh.num_tets(), stiffness, "tet"));
  TF_RETURN_IF_ERROR(CheckEveryComponentConstrained(mesh.tets(), mesh.num_vertices(), constraints));
  const Stopwatch stopwatch;
  auto deformer =
      std::make_unique<GradientFieldDeformer>(ElementsOf(mesh), stiffness, constraints, options);
  const SparseMatrix L = CotangentLaplacian(mesh, stiffness, options.threads);
  const double assemble_seconds = stopwatch.Seconds();
  TF_RETURN_IF_ERROR(deformer->Prepare(L, assemble_seconds));
  return deformer;
}

absl::StatusOr<std::unique_ptr<Deformer>> CreateSurfaceGradientFieldDeformer(
    const TriangleMesh& mesh, const Eigen::VectorXd& stiffness, const ConstraintSet& constraints,
    const GradientFieldOptions& options) {
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_RETURN_IF_ERROR(CheckStiffness(mesh.num_triangles(), stiffness, "triangle"));
  TF_RETURN_IF_ERROR(
      CheckEveryComponentConstrained(mesh.triangles(), mesh.num_vertices(), constraints));
  const Stopwatch stopwatch;
  PiecewiseLinearElements elements = ElementsOf(mesh, options.threads);
  TF_RETURN_IF_ERROR(CheckAreas(elements));
  auto deformer =
      std::make_unique<GradientFieldDeformer>(std::move(elements), stiffness, constraints, options);
  const SparseMatrix L = CotangentLaplacian(mesh, stiffness, options.threads);
  const double assemble_seconds = stopwatch.Seconds();
  TF_RETURN_IF_ERROR(deformer->Prepare(L, assemble_seconds));
  return deformer;
}

}  // namespace tissueform
