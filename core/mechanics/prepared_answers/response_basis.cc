// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/response_basis.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/answer_evaluator/pose_factors.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/harmonic_fields.h"
#include "core/mechanics/prepared_answers/chosen_vertices.h"
#include "core/mechanics/prepared_answers/compressed_columns.h"
#include "core/mechanics/prepared_answers/pose_samples.h"
#include "core/mechanics/prepared_answers/rotation_expansion.h"
#include "core/mechanics/prepared_answers/term_responses.h"

namespace tissueform {
namespace {

// Polynomials that are solved for in one pass over the factor, and evaluated in one pass over the
// cells. With three handles 12 take 1.1 times as long, 6 take 1.6 times; more take more memory.
constexpr Eigen::Index kTermsPerPass = 24;
// Degrees that are expanded beyond those that are answered with: they show the truncation error.
constexpr int kGuardDegrees = 2;
constexpr int kColumnsPerHandle = 4;
// Loads, what of them is solved for, its solution and that of all vertices, side by side.
constexpr Eigen::Index kVectorsPerTerm = 4;
// Measured over test meshes; see PlannedErrorMm.
constexpr double kPlannedGain = 0.5;

absl::Status CheckOptions(const ResponseBasisOptions& options) {
  TF_RETURN_IF_ERROR(CheckTolerance(options.tolerance_mm));
  if (!std::isfinite(options.max_rotation_rad) || options.max_rotation_rad <= 0) {
    return absl::InvalidArgumentError(absl::StrCat("max_rotation_rad is ", options.max_rotation_rad,
                                                   "; it must be a positive number"));
  }
  if (!(options.max_scale_change >= 0 && options.max_scale_change < 1)) {
    return absl::InvalidArgumentError(absl::StrCat("max_scale_change is ", options.max_scale_change,
                                                   "; it must be at least 0 and below 1"));
  }
  return absl::OkStatus();
}

// Of the bound at the edge of the prepared range. With the rotation vectors of two handles opposed
// the field turns by twice the range between them; r is half of what it turns by, and the
// coefficients of degree n of a turning by r cos(t) are 2 J_n(r) <= 2 (r / 2)^n / n!. What a
// polynomial of degree n moves a vertex by is some part of the mesh's size over n.
double PlannedErrorMm(double size_mm, size_t num_handles, int degree,
                      const ResponseBasisOptions& options) {
  const double half_turn = (num_handles > 1 ? 1.0 : 0.5) * options.max_rotation_rad;
  const int n = degree + 1;
  const double factor = std::pow(half_turn / 2, n - 1) / std::tgamma(n + 1);
  const double coefficient =
      2 * factor * ((1 + options.max_scale_change) * half_turn / 2 + options.max_scale_change * n);
  const double polynomials_of_degree =
      static_cast<double>(SimplexPolynomials::NumTerms(static_cast<int>(num_handles) - 1, n));
  return kPlannedGain * size_mm * coefficient * polynomials_of_degree / n;
}

// Of one pass: values at the cells, loads and solutions of all vertices.
int64_t BytesOfPass(const MeshPreparation& preparation, int num_handles, int degree) {
  const Eigen::Index terms =
      std::min(kTermsPerPass, SimplexPolynomials::NumTerms(num_handles, degree + 1));
  const Eigen::Index rows =
      preparation.elements().num_cells() + 3 * kVectorsPerTerm * preparation.mesh().num_vertices();
  return terms * rows * static_cast<int64_t>(sizeof(double));
}

ResponseBasisPlan PlanOfDegree(int degree, const MeshPreparation& preparation,
                               Eigen::Index num_vertices) {
  const int k = static_cast<int>(preparation.constraints().handles().size());
  ResponseBasisPlan plan;
  plan.degree = degree;
  plan.num_terms =
      static_cast<int>(3 * SimplexPolynomials::NumTerms(k, degree)) + kColumnsPerHandle * k;
  plan.bytes = CompressedColumnsBytes(num_vertices, ColumnRows::kVertices, plan.num_terms) +
               RotationExpansionBytes(k, degree + kGuardDegrees) +
               BytesOfPass(preparation, k, degree);
  return plan;
}

// Makes the answers' parts one after the other.
class ResponseBasisBuilder {
 public:
  ResponseBasisBuilder(const ResponseBasisPlan& plan, const ResponseBasisOptions& options,
                       const SimplexDomain& domain)
      : options_(options),
        num_polynomials_(
            SimplexPolynomials::NumTerms(static_cast<int>(domain.dimension()), plan.degree)),
        degree_(plan.degree),
        domain_(domain),
        polynomials_(static_cast<int>(domain.dimension()), plan.degree + kGuardDegrees) {
    DescribeExpansion(domain_, polynomials_, &answers_);
    AnswerNumbers& numbers = answers_.numbers;
    numbers.model = static_cast<double>(AnswerModel::kGradientField);
    numbers.tolerance_mm = options_.tolerance_mm;
    numbers.max_rotation_rad = options_.max_rotation_rad;
    numbers.max_scale_change = options_.max_scale_change;
    numbers.num_polynomials = static_cast<double>(num_polynomials_);
  }

  absl::StatusOr<std::unique_ptr<VertexResponse>> Build(const std::vector<int32_t>& vertices,
                                                        MeshPreparation* preparation,
                                                        const Cancellation& cancellation) {
    const Positions& rest = preparation->mesh().positions();
    const std::vector<int32_t> free =
        DescribeVertices(rest, preparation->constraints(), vertices, &answers_);
    columns_.resize(static_cast<Eigen::Index>(free.size()),
                    ColumnOfHandle(preparation->constraints().handles().size()));
    TF_RETURN_IF_ERROR(PrepareHandles(free, preparation, cancellation));
    TF_RETURN_IF_ERROR(PreparePolynomials(free, preparation, cancellation));
    TF_RETURN_IF_ERROR(cancellation.Check());
    CompressColumns(rest(free, Eigen::all), ColumnRows::kVertices, columns_, UsesOf(*preparation),
                    options_.tolerance_mm, &answers_);
    return std::make_unique<VertexResponse>(std::move(answers_), static_cast<int>(columns_.cols()));
  }

 private:
  Eigen::Index ColumnOfPolynomial(Eigen::Index n) const { return 3 * (num_polynomials_ - 1 - n); }
  Eigen::Index ColumnOfHandle(size_t h) const {
    return 3 * num_polynomials_ + kColumnsPerHandle * static_cast<Eigen::Index>(h);
  }

  // Columns that are solved for: of the handles, and of the polynomials with a guard degree.
  int64_t NumSolved() const {
    const Eigen::Index measured =
        SimplexPolynomials::NumTerms(polynomials_.dimension(), degree_ + 1);
    return columns_.cols() + 3 * (measured - num_polynomials_);
  }
  void ReportSolved(int64_t columns) const {
    ReportProgress(options_.observer, PreparationStage::kAnswers, columns, NumSolved());
  }

  absl::Status PrepareHandles(const std::vector<int32_t>& free, MeshPreparation* preparation,
                              const Cancellation& cancellation) {
    TF_ASSIGN_OR_RETURN(const PreparedLaplacian* laplacian, preparation->Laplacian());
    const std::vector<HandleRegion>& handles = preparation->constraints().handles();
    for (size_t h = 0; h < handles.size(); ++h) {
      TF_RETURN_IF_ERROR(cancellation.Check());
      ReportSolved(kColumnsPerHandle * static_cast<int64_t>(h));
      const Positions& rest = preparation->mesh().positions();
      const Eigen::Vector3d origin = rest(handles[h].vertices, Eigen::all).colwise().mean();
      answers_.origins.insert(answers_.origins.end(), origin.begin(), origin.end());
      TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd X,
                          HandleResponse(static_cast<int>(h), origin, preparation));
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        columns_.col(ColumnOfHandle(h) + axis) = X(free, axis);
      }
      columns_.col(ColumnOfHandle(h) + 3) = laplacian->harmonic(free, static_cast<Eigen::Index>(h));
    }
    return absl::OkStatus();
  }

  // Columns up to degree_, gains one degree further: the largest displacement that a polynomial of
  // that degree gives one of the free ones, each, and that any one does. Of every pass only the
  // free rows are kept.
  absl::Status PreparePolynomials(const std::vector<int32_t>& free, MeshPreparation* preparation,
                                  const Cancellation& cancellation) {
    const Eigen::Index measured =
        SimplexPolynomials::NumTerms(polynomials_.dimension(), degree_ + 1);
    double& largest_gain = answers_.numbers.largest_gain_mm;
    for (Eigen::Index first = 0; first < measured; first += kTermsPerPass) {
      ReportSolved(NumSolved() - 3 * (measured - first));
      TF_RETURN_IF_ERROR(cancellation.Check());
      const Eigen::Index count = std::min(kTermsPerPass, measured - first);
      TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd responses,
                          TermResponses(domain_, polynomials_, first, count, preparation));
      for (Eigen::Index n = first; n < first + count; ++n) {
        const Positions chosen = responses.middleCols<3>(3 * (n - first))(free, Eigen::all);
        const double gain = free.empty() ? 0 : chosen.rowwise().norm().maxCoeff();
        largest_gain = std::max(largest_gain, gain);
        if (n >= num_polynomials_) {
          answers_.guard_gains.push_back(gain);
          continue;
        }
        for (Eigen::Index axis = 0; axis < 3; ++axis) {
          columns_.col(ColumnOfPolynomial(n) + axis) = responses(free, 3 * (n - first) + axis);
        }
      }
    }
    ReportSolved(NumSolved());
    return absl::OkStatus();
  }

  ColumnWeights UsesOf(const MeshPreparation& preparation) const {
    constexpr int kSamples = 300;
    const double size_mm = preparation.mesh().BoundingBoxDiagonal();
    PoseRange range{.rotation_rad = options_.max_rotation_rad,
                    .scale_change = options_.max_scale_change,
                    .translation_mm = 0.05 * size_mm,
                    .pivot_offset_mm = 0.1 * size_mm};
    const std::vector<Eigen::Vector3d> centroids = HandleCentroids(preparation);
    ColumnWeights uses{.factors = 3, .typical = {}, .widest = {}};
    uses.typical = FactorsOfAll(SamplePoses(centroids, range, kSamples));
    // Moves have no range: a sixth of the mesh, which is 3 cm on a head, beside those of turns
    // about a far pivot. Farther ones are covered as far as the digits go that these need.
    range.translation_mm = 0.15 * size_mm;
    range.pivot_offset_mm = 0.9 * size_mm;
    uses.widest = FactorsOfAll(SamplePoses(centroids, range, kSamples));
    return uses;
  }

  Eigen::MatrixXd FactorsOfAll(const std::vector<std::vector<HandlePose>>& samples) const {
    Eigen::MatrixXd factors(columns_.cols(), 3 * static_cast<Eigen::Index>(samples.size()));
    for (size_t s = 0; s < samples.size(); ++s) {
      const std::vector<double> own = FactorsOf(answers_, ToAnswerPoses(samples[s])).factors;
      factors.middleCols<3>(3 * static_cast<Eigen::Index>(s)) =
          Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(
              own.data(), columns_.cols(), 3);
    }
    return factors;
  }

  const ResponseBasisOptions options_;
  const Eigen::Index num_polynomials_;
  const int degree_;
  const SimplexDomain domain_;
  const SimplexPolynomials polynomials_;  // with the guard degrees
  PortableAnswers answers_;
  Eigen::MatrixXd columns_;  // of the free ones
};

}  // namespace

absl::StatusOr<ResponseBasisPlan> PlanResponseBasis(const MeshPreparation& preparation,
                                                    Eigen::Index num_vertices,
                                                    const ResponseBasisOptions& options) {
  TF_RETURN_IF_ERROR(CheckOptions(options));
  const size_t num_handles = preparation.constraints().handles().size();
  const double size_mm = preparation.mesh().BoundingBoxDiagonal();
  for (int degree = 1;; ++degree) {
    if (SimplexPolynomials::NumTerms(static_cast<int>(num_handles), degree) >
        kMaxResponsePolynomials) {
      return absl::InvalidArgumentError(
          absl::StrCat("a response basis for ", num_handles, " handles, ", options.max_rotation_rad,
                       " rad and ", options.tolerance_mm, " mm would need more than ",
                       kMaxResponsePolynomials, " polynomials; prepare a smaller range"));
    }
    if (PlannedErrorMm(size_mm, num_handles, degree, options) <= options.tolerance_mm) {
      return PlanOfDegree(degree, preparation, num_vertices);
    }
  }
}

absl::StatusOr<std::unique_ptr<VertexResponse>> CreateResponseBasis(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const ResponseBasisOptions& options, const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckChosenVertices(vertices, preparation->mesh().num_vertices()));
  TF_ASSIGN_OR_RETURN(
      const ResponseBasisPlan plan,
      PlanResponseBasis(*preparation, static_cast<Eigen::Index>(vertices.size()), options));
  TF_RETURN_IF_ERROR(cancellation.Check());
  if (options.admission) {
    TF_RETURN_IF_ERROR(options.admission(plan.bytes));
  }
  TF_ASSIGN_OR_RETURN(const PreparedLaplacian* laplacian, preparation->Laplacian(cancellation));
  return ResponseBasisBuilder(plan, options,
                              EnclosingSimplex(SampleAtBarycentres(preparation->elements().cells,
                                                                   laplacian->harmonic)))
      .Build(vertices, preparation.get(), cancellation);
}

}  // namespace tissueform
