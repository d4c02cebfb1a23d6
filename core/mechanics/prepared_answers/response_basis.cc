// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/response_basis.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/harmonic_fields.h"
#include "core/mechanics/prepared_answers/chosen_vertices.h"
#include "core/mechanics/prepared_answers/compressed_response.h"
#include "core/mechanics/prepared_answers/pose_samples.h"
#include "core/mechanics/prepared_answers/rotation_expansion.h"
#include "core/mechanics/prepared_answers/term_responses.h"

namespace tissueform {
namespace {

// Polynomials that are solved for in one pass over the factor, and evaluated in one pass over the
// cells. With three handles 12 take 1.1 times as long, 6 take 1.6 times; more take more memory.
constexpr Eigen::Index kTermsPerPass = 24;
// Degrees that are expanded beyond those that are answered with: they tell the truncation error.
constexpr int kGuardDegrees = 2;
constexpr int kColumnsPerHandle = 4;
// Loads, what of them is solved for, its solution and that of all vertices, side by side.
constexpr Eigen::Index kVectorsPerTerm = 4;
// Measured over test meshes; see PlannedErrorMm.
constexpr double kPlannedGain = 0.5;
// Responses fall with the degree; this allows for those of the second guard degree, which are not
// measured, not doing so.
constexpr double kGainAllowance = 1.5;

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
  plan.bytes = CompressedResponse::BytesNeeded(num_vertices, CompressedResponse::Rows::kVertices,
                                               plan.num_terms) +
               RotationExpansion::BytesNeeded(k, degree + kGuardDegrees) +
               BytesOfPass(preparation, k, degree);
  return plan;
}

class ResponseBasis : public VertexResponse {
 public:
  ResponseBasis(const ResponseBasisPlan& plan, const ResponseBasisOptions& options,
                const SimplexDomain& domain, ChosenVertices chosen)
      : options_(options),
        num_polynomials_(
            SimplexPolynomials::NumTerms(static_cast<int>(domain.dimension()), plan.degree)),
        degree_(plan.degree),
        domain_(domain),
        expansion_(domain, plan.degree + kGuardDegrees),
        chosen_(std::move(chosen)),
        columns_(chosen_.num_free(), plan.num_terms) {}

  // `free`: those of the chosen vertices.
  absl::Status Prepare(const std::vector<int32_t>& free, MeshPreparation* preparation,
                       const Cancellation& cancellation) {
    TF_RETURN_IF_ERROR(PrepareHandles(free, preparation, cancellation));
    TF_RETURN_IF_ERROR(PreparePolynomials(free, preparation, cancellation));
    TF_RETURN_IF_ERROR(cancellation.Check());
    panel_.emplace(preparation->mesh().positions()(free, Eigen::all),
                   CompressedResponse::Rows::kVertices, columns_, UsesOf(*preparation),
                   options_.tolerance_mm);
    columns_.resize(0, 0);
    return absl::OkStatus();
  }

  double ErrorBoundMm(absl::Span<const HandlePose> poses) const override {
    return Plan(poses).bound_mm;
  }

  bool Covers(absl::Span<const HandlePose> poses) const override {
    return InRange(poses) && ErrorBoundMm(poses) <= options_.tolerance_mm;
  }

  void Evaluate(absl::Span<const HandlePose> poses, FloatPositions* positions) const override {
    Write(poses, Plan(poses), positions);
  }

  std::optional<double> Answer(absl::Span<const HandlePose> poses,
                               FloatPositions* positions) const override {
    if (!InRange(poses)) return std::nullopt;
    const PlannedAnswer plan = Plan(poses);
    if (!(plan.bound_mm <= options_.tolerance_mm)) return std::nullopt;
    Write(poses, plan, positions);
    return plan.bound_mm;
  }

  PortableAnswers Describe() const override {
    PortableAnswers answers;
    chosen_.Describe(&answers);
    panel_->Describe(&answers);
    expansion_.Describe(&answers);
    AnswerNumbers& numbers = answers.numbers;
    numbers.model = static_cast<double>(AnswerModel::kGradientField);
    numbers.tolerance_mm = options_.tolerance_mm;
    numbers.max_rotation_rad = options_.max_rotation_rad;
    numbers.max_scale_change = options_.max_scale_change;
    numbers.num_polynomials = static_cast<double>(num_polynomials_);
    numbers.largest_gain_mm = largest_gain_;
    answers.guard_gains.assign(guard_gains_.begin(), guard_gains_.end());
    for (const Eigen::Vector3d& origin : origins_) {
      answers.origins.insert(answers.origins.end(), origin.begin(), origin.end());
    }
    return answers;
  }

  Eigen::Index num_vertices() const override { return chosen_.size(); }
  int num_terms() const override { return static_cast<int>(panel_->num_columns()); }
  int num_terms_before() const override { return static_cast<int>(panel_->num_columns_before()); }
  int64_t bytes_held() const override {
    return panel_->bytes_held() + chosen_.bytes_held() + expansion_.bytes_held() +
           (guard_gains_.size() + 3 * static_cast<Eigen::Index>(origins_.size())) *
               static_cast<int64_t>(sizeof(double));
  }

 private:
  // Of poses.
  struct PlannedAnswer {
    CompressedResponse::EvaluationPlan reading;
    double bound_mm = 0;  // with what the expansion leaves out
  };

  Eigen::Index num_columns() const { return ColumnOfHandle(origins_.size()); }
  Eigen::Index ColumnOfPolynomial(Eigen::Index n) const { return 3 * (num_polynomials_ - 1 - n); }
  Eigen::Index ColumnOfHandle(size_t h) const {
    return 3 * num_polynomials_ + kColumnsPerHandle * static_cast<Eigen::Index>(h);
  }

  // Columns that are solved for: of the handles, and of the polynomials with a guard degree.
  int64_t NumSolved() const {
    const Eigen::Index measured =
        SimplexPolynomials::NumTerms(expansion_.polynomials().dimension(), degree_ + 1);
    return columns_.cols() + 3 * (measured - num_polynomials_);
  }
  void TellSolved(int64_t columns) const {
    TellProgress(options_.observer, PreparationStage::kAnswers, columns, NumSolved());
  }

  absl::Status PrepareHandles(const std::vector<int32_t>& free, MeshPreparation* preparation,
                              const Cancellation& cancellation) {
    TF_ASSIGN_OR_RETURN(const PreparedLaplacian* laplacian, preparation->Laplacian());
    const std::vector<HandleRegion>& handles = preparation->constraints().handles();
    for (size_t h = 0; h < handles.size(); ++h) {
      TF_RETURN_IF_ERROR(cancellation.Check());
      TellSolved(kColumnsPerHandle * static_cast<int64_t>(h));
      const Positions& rest = preparation->mesh().positions();
      origins_.emplace_back(rest(handles[h].vertices, Eigen::all).colwise().mean());
      TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd X,
                          HandleResponse(static_cast<int>(h), origins_.back(), preparation));
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        columns_.col(ColumnOfHandle(h) + axis) = X(free, axis);
      }
      columns_.col(ColumnOfHandle(h) + 3) = laplacian->harmonic(free, static_cast<Eigen::Index>(h));
    }
    return absl::OkStatus();
  }

  // Columns up to degree_, gains one degree further. Of every pass only the free rows are kept.
  absl::Status PreparePolynomials(const std::vector<int32_t>& free, MeshPreparation* preparation,
                                  const Cancellation& cancellation) {
    const SimplexPolynomials& polynomials = expansion_.polynomials();
    const Eigen::Index measured =
        SimplexPolynomials::NumTerms(polynomials.dimension(), degree_ + 1);
    guard_gains_.setZero(measured - num_polynomials_);
    for (Eigen::Index first = 0; first < measured; first += kTermsPerPass) {
      TellSolved(NumSolved() - 3 * (measured - first));
      TF_RETURN_IF_ERROR(cancellation.Check());
      const Eigen::Index count = std::min(kTermsPerPass, measured - first);
      TF_ASSIGN_OR_RETURN(const Eigen::MatrixXd responses,
                          TermResponses(domain_, polynomials, first, count, preparation));
      for (Eigen::Index n = first; n < first + count; ++n) {
        const Positions chosen = responses.middleCols<3>(3 * (n - first))(free, Eigen::all);
        const double gain = free.empty() ? 0 : chosen.rowwise().norm().maxCoeff();
        largest_gain_ = std::max(largest_gain_, gain);
        if (n >= num_polynomials_) {
          guard_gains_[n - num_polynomials_] = gain;
          continue;
        }
        for (Eigen::Index axis = 0; axis < 3; ++axis) {
          columns_.col(ColumnOfPolynomial(n) + axis) = responses(free, 3 * (n - first) + axis);
        }
      }
    }
    TellSolved(NumSolved());
    return absl::OkStatus();
  }

  bool InRange(absl::Span<const HandlePose> poses) const {
    constexpr double kSlack = 1 + 1e-9;  // the edge of the range belongs to it
    return std::all_of(poses.begin(), poses.end(), [this](const HandlePose& pose) {
      return pose.rotation_vector.norm() <= options_.max_rotation_rad * kSlack &&
             std::abs(pose.scale - 1) <= options_.max_scale_change + (kSlack - 1);
    });
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
    uses.typical = FactorsOf(SamplePoses(centroids, range, kSamples));
    // Moves have no range: a sixth of the mesh, which is 3 cm on a head, beside those of turns
    // about a far pivot. Farther ones are covered as far as the digits go that these need.
    range.translation_mm = 0.15 * size_mm;
    range.pivot_offset_mm = 0.9 * size_mm;
    uses.widest = FactorsOf(SamplePoses(centroids, range, kSamples));
    return uses;
  }

  Eigen::MatrixXd FactorsOf(const std::vector<std::vector<HandlePose>>& samples) const {
    Eigen::MatrixXd factors(num_columns(), 3 * static_cast<Eigen::Index>(samples.size()));
    for (size_t s = 0; s < samples.size(); ++s) {
      factors.middleCols<3>(3 * static_cast<Eigen::Index>(s)) =
          Factors(samples[s], expansion_.Expand(samples[s]));
    }
    return factors;
  }

  PlannedAnswer Plan(absl::Span<const HandlePose> poses) const {
    const ExpansionCoefficients coefficients = expansion_.Expand(poses);
    PlannedAnswer plan;
    const double truncation_mm = TruncationBoundMm(poses, coefficients);
    plan.reading =
        panel_->Choose(Factors(poses, coefficients), options_.tolerance_mm - truncation_mm);
    plan.bound_mm = std::max(truncation_mm + plan.reading.bound_mm, chosen_.RoundingBoundMm(poses));
    return plan;
  }

  void Write(absl::Span<const HandlePose> poses, const PlannedAnswer& plan,
             FloatPositions* positions) const {
    positions->resize(chosen_.size(), 3);
    panel_->Evaluate(plan.reading, positions);
    chosen_.Complete(poses, positions);
  }

  Eigen::MatrixXd Factors(absl::Span<const HandlePose> poses,
                          const ExpansionCoefficients& coefficients) const {
    Eigen::MatrixXd factors(num_columns(), 3);
    for (Eigen::Index n = 0; n < num_polynomials_; ++n) {
      // Row-major C seen column-major is its transpose.
      factors.middleRows<3>(ColumnOfPolynomial(n)) =
          Eigen::Map<const Eigen::Matrix3d>(coefficients.row(n).data());
    }
    for (size_t h = 0; h < poses.size(); ++h) {
      const HandlePose& pose = poses[h];
      const Eigen::Matrix3d turn =
          pose.scale * RotationMatrix(pose.rotation_vector) - Eigen::Matrix3d::Identity();
      factors.middleRows<3>(ColumnOfHandle(h)) = turn.transpose();
      factors.row(ColumnOfHandle(h) + 3) =
          turn * (origins_[h] - pose.pivot_mm) + pose.translation_mm;
    }
    return factors;
  }

  double TruncationBoundMm(absl::Span<const HandlePose> poses,
                           const ExpansionCoefficients& coefficients) const {
    const Eigen::Index guards = guard_gains_.size();
    if (guards == 0) {
      return 0;
    }
    const Eigen::VectorXd sizes = coefficients.rowwise().norm();
    const Eigen::Index unmeasured = sizes.size() - num_polynomials_ - guards;
    return sizes.segment(num_polynomials_, guards).dot(guard_gains_) +
           kGainAllowance * guard_gains_.maxCoeff() * sizes.tail(unmeasured).sum() +
           largest_gain_ * expansion_.RemainderBound(poses, degree_ + kGuardDegrees);
  }

  // Constant after Prepare.
  const ResponseBasisOptions options_;
  const Eigen::Index num_polynomials_;
  const int degree_;
  const SimplexDomain domain_;
  const RotationExpansion expansion_;  // with the guard degrees
  const ChosenVertices chosen_;
  Eigen::MatrixXd columns_;  // of the free ones; empty after Prepare
  std::optional<CompressedResponse> panel_;
  std::vector<Eigen::Vector3d> origins_;  // o_h
  // Largest displacement that a polynomial of degree degree_ + 1 gives one of the free ones, each;
  // and that any one does, mm.
  Eigen::VectorXd guard_gains_;
  double largest_gain_ = 0;
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
  ChosenVertices chosen(preparation->mesh().positions(), preparation->constraints(), vertices);
  const std::vector<int32_t> free = chosen.FreeAmong(vertices);
  auto basis = std::make_unique<ResponseBasis>(
      plan, options,
      EnclosingSimplex(SampleAtBarycentres(preparation->elements().cells, laplacian->harmonic)),
      std::move(chosen));
  TF_RETURN_IF_ERROR(basis->Prepare(free, preparation.get(), cancellation));
  return basis;
}

}  // namespace tissueform
