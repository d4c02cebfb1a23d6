// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/prepared_answers/neo_hookean_response.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/deformation/deformation_checks.h"
#include "core/deformation/neo_hookean_deformer.h"
#include "core/elasticity/neo_hookean_expansion.h"
#include "core/prepared_answers/panel_response.h"
#include "core/prepared_answers/pose_samples.h"

namespace tissueform {
namespace {

constexpr Eigen::Index kNumbersPerHandle = 6;  // rotation vector, translation
// Pairs that are solved for in one pass over the factor.
constexpr Eigen::Index kPairsPerPass = 24;
// Of the converged answers that the estimate is measured by, and what is put on top of the worst.
constexpr int kMostCalibrationIterations = 60;
constexpr double kEstimateAllowance = 1.5;

Eigen::Index NumHandles(const MeshPreparation& preparation) {
  return static_cast<Eigen::Index>(preparation.constraints().handles().size());
}

Eigen::Index NumFirst(const MeshPreparation& preparation) {
  return ElasticSystem::kColumnsPerHandle * NumHandles(preparation);
}

Eigen::Index NumColumns(const MeshPreparation& preparation) {
  return NumFirst(preparation) + NumFieldPairs(kNumbersPerHandle * NumHandles(preparation));
}

absl::Status CheckOptions(const NeoHookeanResponseOptions& options) {
  TF_RETURN_IF_ERROR(CheckTolerance(options.tolerance_mm));
  for (const auto& [name, value] : {std::pair("max_rotation_rad", options.max_rotation_rad),
                                    std::pair("max_estimate_mm", options.max_estimate_mm)}) {
    if (!std::isfinite(value) || value <= 0) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " is ", value, "; it must be a positive number"));
    }
  }
  return absl::OkStatus();
}

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& w) {
  Eigen::Matrix3d cross;
  cross << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return cross;
}

double LargestMove(const Eigen::Ref<const Eigen::VectorXd>& column) {
  return column.size() == 0 ? 0 : column.reshaped(3, column.size() / 3).colwise().norm().maxCoeff();
}

class NeoHookeanResponse : public VertexResponse {
 public:
  NeoHookeanResponse(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic,
                     NeoHookeanResponseOptions options)
      : preparation_(std::move(preparation)),
        elastic_(elastic),
        options_(std::move(options)),
        centroids_(HandleCentroids(*preparation_)) {}

  absl::Status Prepare(const std::vector<int32_t>& vertices, const Cancellation& cancellation) {
    Eigen::MatrixXd columns(3 * static_cast<Eigen::Index>(vertices.size()),
                            NumColumns(*preparation_));
    columns.leftCols(NumFirst(*preparation_)) =
        RowsOfVertices(elastic_.response_columns(), vertices);
    TF_RETURN_IF_ERROR(PrepareSecondOrder(vertices, cancellation, &columns));
    TF_RETURN_IF_ERROR(Calibrate(vertices, columns, cancellation));
    TF_RETURN_IF_ERROR(cancellation.Check());
    panel_.emplace(preparation_->mesh().positions()(vertices, Eigen::all),
                   PanelResponse::Rows::kCoordinates, columns, Uses(), options_.tolerance_mm);
    return absl::OkStatus();
  }

  double ErrorBoundMm(absl::Span<const HandlePose> poses) const override {
    return Plan(poses).error_mm;
  }
  bool error_is_estimate() const override { return true; }

  bool Covers(absl::Span<const HandlePose> poses) const override {
    return InRange(poses) && ErrorBoundMm(poses) <= options_.max_estimate_mm;
  }

  void Evaluate(absl::Span<const HandlePose> poses, FloatPositions* positions) const override {
    panel_->Evaluate(Plan(poses).reading, positions);
  }

  std::optional<double> Answer(absl::Span<const HandlePose> poses,
                               FloatPositions* positions) const override {
    if (!InRange(poses)) return std::nullopt;
    const PlannedAnswer plan = Plan(poses);
    if (!(plan.error_mm <= options_.max_estimate_mm)) return std::nullopt;
    panel_->Evaluate(plan.reading, positions);
    return plan.error_mm;
  }

  Eigen::Index num_vertices() const override { return panel_->num_vertices(); }
  int num_terms() const override { return static_cast<int>(panel_->num_columns()); }
  int num_terms_before() const override { return static_cast<int>(panel_->num_columns_before()); }
  int64_t bytes_held() const override {
    return panel_->bytes_held() +
           (first_gains_.size() + pair_gains_.size()) * static_cast<int64_t>(sizeof(double));
  }

 private:
  struct PlannedAnswer {
    PanelResponse::Reading reading;
    double error_mm = 0;  // estimated, with the bound of the columns
  };

  // Six numbers a handle. Not the angle itself but its sine: what R - I is odd in, so that the
  // columns of u1, which hold R - I whole, and these agree to third order either way.
  Eigen::VectorXd Numbers(absl::Span<const HandlePose> poses) const {
    Eigen::VectorXd numbers(kNumbersPerHandle * static_cast<Eigen::Index>(poses.size()));
    for (size_t h = 0; h < poses.size(); ++h) {
      const Eigen::Matrix3d R = RotationMatrix(poses[h].rotation_vector);
      const Eigen::Vector3d& centroid = centroids_[h];
      auto own =
          numbers.segment<kNumbersPerHandle>(kNumbersPerHandle * static_cast<Eigen::Index>(h));
      own.head<3>() =
          0.5 * Eigen::Vector3d(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
      own.tail<3>() = ApplyPose(poses[h], centroid) - centroid;
    }
    return numbers;
  }

  // Of poses: what the columns are multiplied with.
  Eigen::VectorXd Factors(absl::Span<const HandlePose> poses,
                          const Eigen::VectorXd& numbers) const {
    Eigen::VectorXd factors(NumColumns(*preparation_));
    factors.head(NumFirst(*preparation_)) = elastic_.Coefficients(poses);
    Eigen::Index pair = NumFirst(*preparation_);
    for (Eigen::Index a = 0; a < numbers.size(); ++a) {
      for (Eigen::Index b = a; b < numbers.size(); ++b) {
        factors[pair++] = (a == b ? 1 : 2) * numbers[a] * numbers[b];
      }
    }
    return factors;
  }

  // Displacements, a unit of each number: of all vertices, 3 #V by #numbers.
  Eigen::MatrixXd LinearFields() const {
    Eigen::MatrixXd coefficients = Eigen::MatrixXd::Zero(
        NumFirst(*preparation_), kNumbersPerHandle * static_cast<Eigen::Index>(centroids_.size()));
    for (size_t h = 0; h < centroids_.size(); ++h) {
      const Eigen::Index first = ElasticSystem::kColumnsPerHandle * static_cast<Eigen::Index>(h);
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Index number = kNumbersPerHandle * static_cast<Eigen::Index>(h) + axis;
        // v -> A (v - c) displaces by A (v - o) + A (o - c), o the origin of the columns.
        const Eigen::Matrix3d A = CrossMatrix(Eigen::Vector3d::Unit(axis));
        const Eigen::Vector3d b = A * (elastic_.origin() - centroids_[h]);
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) coefficients(first + 4 * i + j, number) = A(i, j);
          coefficients(first + 4 * i + 3, number) = b[i];
        }
        coefficients(first + 4 * axis + 3, number + 3) = 1;
      }
    }
    return elastic_.response_columns() * coefficients;
  }

  absl::Status PrepareSecondOrder(const std::vector<int32_t>& vertices,
                                  const Cancellation& cancellation, Eigen::MatrixXd* columns) {
    const Eigen::MatrixXd fields = LinearFields();
    first_gains_.resize(fields.cols());
    const Eigen::MatrixXd chosen = RowsOfVertices(fields, vertices);
    for (Eigen::Index f = 0; f < fields.cols(); ++f) first_gains_[f] = LargestMove(chosen.col(f));
    const Eigen::MatrixXd forces =
        SecondOrderForces(preparation_->elements(), preparation_->stiffness(),
                          preparation_->options().poisson_ratio, fields);
    const Eigen::Index pairs = forces.cols();
    pair_gains_.resize(pairs);
    const Eigen::MatrixXd at_rest = Eigen::MatrixXd::Zero(
        3 * static_cast<Eigen::Index>(preparation_->constraints().constrained().size()),
        kPairsPerPass);
    for (Eigen::Index first = 0; first < pairs; first += kPairsPerPass) {
      TF_RETURN_IF_ERROR(cancellation.Check());
      TellProgress(options_.observer, PreparationStage::kAnswers, first, pairs);
      const Eigen::Index count = std::min(kPairsPerPass, pairs - first);
      TF_ASSIGN_OR_RETURN(
          const Eigen::MatrixXd second,
          elastic_.Solve(-forces.middleCols(first, count), at_rest.leftCols(count)));
      auto own = columns->middleCols(NumFirst(*preparation_) + first, count);
      own = RowsOfVertices(second, vertices);
      for (Eigen::Index c = 0; c < count; ++c) pair_gains_[first + c] = LargestMove(own.col(c));
    }
    TellProgress(options_.observer, PreparationStage::kAnswers, pairs, pairs);
    return absl::OkStatus();
  }

  ColumnUses Uses() const {
    constexpr int kSamples = 600;
    const double size_mm = preparation_->mesh().BoundingBoxDiagonal();
    PoseRange range{.rotation_rad = options_.max_rotation_rad,
                    .scale_change = 0,
                    .translation_mm = 0.05 * size_mm,
                    .pivot_offset_mm = 0.05 * size_mm};
    ColumnUses uses{.factors = 1, .typical = {}, .widest = {}};
    uses.typical = FactorsOf(CoveredSamples(range, kSamples));
    range.translation_mm = 0.15 * size_mm;
    range.pivot_offset_mm = 0.15 * size_mm;
    uses.widest = FactorsOf(CoveredSamples(range, kSamples));
    return uses;
  }

  // Those that are not covered are made smaller until they are: nobody asks for the rest.
  std::vector<std::vector<HandlePose>> CoveredSamples(const PoseRange& range, int count) const {
    constexpr double kSmaller = 0.8;
    std::vector<std::vector<HandlePose>> samples = SamplePoses(centroids_, range, count);
    for (std::vector<HandlePose>& poses : samples) {
      while (third_order_factor_ * ThirdOrderMm(Numbers(poses)) > options_.max_estimate_mm) {
        for (HandlePose& pose : poses) pose = PartOfPose(pose, kSmaller);
      }
    }
    return samples;
  }

  Eigen::MatrixXd FactorsOf(const std::vector<std::vector<HandlePose>>& samples) const {
    Eigen::MatrixXd factors(NumColumns(*preparation_), static_cast<Eigen::Index>(samples.size()));
    for (size_t s = 0; s < samples.size(); ++s) {
      factors.col(static_cast<Eigen::Index>(s)) = Factors(samples[s], Numbers(samples[s]));
    }
    return factors;
  }

  bool InRange(absl::Span<const HandlePose> poses) const {
    constexpr double kSlack = 1 + 1e-9;  // the edge of the range belongs to it
    return std::all_of(poses.begin(), poses.end(), [this](const HandlePose& pose) {
      return pose.rotation_vector.norm() <= options_.max_rotation_rad * kSlack && pose.scale == 1;
    });
  }

  // Before it is calibrated: |u2|^2 / |u1|, with what the numbers can move at most in place of what
  // they do.
  double ThirdOrderMm(const Eigen::VectorXd& numbers) const {
    const double first = first_gains_.dot(numbers.cwiseAbs());
    double second = 0;
    Eigen::Index pair = 0;
    for (Eigen::Index a = 0; a < numbers.size(); ++a) {
      for (Eigen::Index b = a; b < numbers.size(); ++b) {
        second += (a == b ? 1 : 2) * std::abs(numbers[a] * numbers[b]) * pair_gains_[pair++];
      }
    }
    return first > 0 ? second * second / first : 0;
  }

  PlannedAnswer Plan(absl::Span<const HandlePose> poses) const {
    const Eigen::VectorXd numbers = Numbers(poses);
    PlannedAnswer plan;
    plan.reading = panel_->Choose(Factors(poses, numbers), options_.tolerance_mm);
    plan.error_mm = third_order_factor_ * ThirdOrderMm(numbers) + plan.reading.bound_mm;
    return plan;
  }

  // Against what the model converges to. `columns`: of the chosen vertices.
  absl::Status Calibrate(const std::vector<int32_t>& vertices, const Eigen::MatrixXd& columns,
                         const Cancellation& cancellation) {
    NeoHookeanOptions options;
    options.max_iterations = kMostCalibrationIterations;
    TF_ASSIGN_OR_RETURN(const std::unique_ptr<Deformer> deformer,
                        CreateNeoHookeanDeformer(preparation_, options, cancellation));
    DeformControl control;
    control.on_progress = [&cancellation](const Deformation& /*so_far*/) {
      return cancellation.Check().ok();
    };
    const double size_mm = preparation_->mesh().BoundingBoxDiagonal();
    std::optional<double> worst;
    // A small turn, a small move and both, since the series does not fall alike for them: 2 mm on a
    // head. So small that converging takes some ten iterations each, and large enough for the third
    // order to stand above the columns' and the search's own errors.
    const double turn_rad = std::min(options_.max_rotation_rad, std::numbers::pi / 60);
    const double move_mm = size_mm / 100;
    for (const auto& [rotation_rad, translation_mm] :
         {std::pair(turn_rad, 0.0), std::pair(0.0, move_mm), std::pair(turn_rad, move_mm)}) {
      const PoseRange range{.rotation_rad = rotation_rad,
                            .scale_change = 0,
                            .translation_mm = translation_mm,
                            .pivot_offset_mm = 0};
      const std::vector<HandlePose> poses = SamplePoses(centroids_, range, 2).back();
      TF_ASSIGN_OR_RETURN(const Deformation converged, deformer->Deform(poses, control));
      TF_RETURN_IF_ERROR(cancellation.Check());
      if (!converged.summary.converged) continue;  // nothing is learnt from it
      const Eigen::VectorXd numbers = Numbers(poses);
      const Eigen::VectorXd answer = columns * Factors(poses, numbers);
      const Positions displacements =
          (converged.positions - preparation_->mesh().positions())(vertices, Eigen::all);
      const double error = LargestMove(answer - displacements.reshaped<Eigen::RowMajor>());
      const double third_order = ThirdOrderMm(numbers);
      if (third_order > 0) worst = std::max(worst.value_or(0), error / third_order);
    }
    // Where nothing converged all is as bad as it can be: the series as if it fell no faster than
    // its bounds do.
    third_order_factor_ = worst.has_value() ? kEstimateAllowance * *worst : 1;
    return absl::OkStatus();
  }

  // Constant after Prepare.
  const std::shared_ptr<MeshPreparation> preparation_;  // owns elastic_
  const ElasticSystem& elastic_;
  const NeoHookeanResponseOptions options_;
  const std::vector<Eigen::Vector3d> centroids_;
  std::optional<PanelResponse> panel_;
  // Largest displacement of a chosen vertex, a unit of every number, and of every pair of them.
  Eigen::VectorXd first_gains_;
  Eigen::VectorXd pair_gains_;
  double third_order_factor_ = 0;
};

}  // namespace

int64_t NeoHookeanResponseBytes(const MeshPreparation& preparation, Eigen::Index num_vertices) {
  const Eigen::Index pairs = NumFieldPairs(kNumbersPerHandle * NumHandles(preparation));
  // Forces of all pairs, a pass of solutions and the fields, of all vertices.
  const int64_t of_all = 3 * preparation.mesh().num_vertices() *
                         (pairs + kPairsPerPass + kNumbersPerHandle * NumHandles(preparation));
  return of_all * static_cast<int64_t>(sizeof(double)) +
         PanelResponse::BytesNeeded(num_vertices, PanelResponse::Rows::kCoordinates,
                                    NumColumns(preparation));
}

absl::StatusOr<std::unique_ptr<VertexResponse>> CreateNeoHookeanResponse(
    const std::shared_ptr<MeshPreparation>& preparation, const std::vector<int32_t>& vertices,
    const NeoHookeanResponseOptions& options, const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckOptions(options));
  TF_RETURN_IF_ERROR(CheckChosenVertices(vertices, preparation->mesh().num_vertices()));
  TF_RETURN_IF_ERROR(cancellation.Check());
  if (options.admission) {
    TF_RETURN_IF_ERROR(options.admission(
        NeoHookeanResponseBytes(*preparation, static_cast<Eigen::Index>(vertices.size()))));
  }
  TF_ASSIGN_OR_RETURN(const ElasticSystem* elastic, preparation->Elastic(cancellation));
  auto response = std::make_unique<NeoHookeanResponse>(preparation, *elastic, options);
  TF_RETURN_IF_ERROR(response->Prepare(vertices, cancellation));
  return response;
}

}  // namespace tissueform
