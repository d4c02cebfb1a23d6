// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/neo_hookean_response.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/answer_evaluator/pose_factors.h"
#include "core/mechanics/answer_evaluator/series_terms.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/neo_hookean_deformer.h"
#include "core/mechanics/elasticity/neo_hookean_expansion.h"
#include "core/mechanics/prepared_answers/chosen_vertices.h"
#include "core/mechanics/prepared_answers/clustered_columns.h"
#include "core/mechanics/prepared_answers/neo_hookean_series.h"
#include "core/mechanics/prepared_answers/pose_samples.h"
#include "core/mechanics/prepared_answers/series_calibration.h"

namespace tissueform {
namespace {

// Of the converged answers that the estimate is measured by, and what is put on top of their
// median: the 99th percentile of random poses. (The worst of a few says less: one pose of the
// bundled head had 4 times the median.)
constexpr int kMaxCalibrationIterations = 60;
constexpr double kEstimateAllowance = 2.5;
// More for every handle beside the first: what lies between two of them differs more from pose to
// pose. Bars with one, two and three handles need 1.9, 2.4 and 3.7.
constexpr double kAllowancePerHandle = 0.75;
// The same of what compression does to uses that were tried.
constexpr double kCutAllowance = 1.25;
// Where the series itself errs by so many mm the columns may err by twice the tolerance.
constexpr double kEstimateThatDoublesMm = 0.5;

Eigen::Index NumHandles(const MeshPreparation& preparation) {
  return static_cast<Eigen::Index>(preparation.constraints().handles().size());
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

double LargestMove(const Eigen::Ref<const Eigen::VectorXd>& column) {
  return column.size() == 0 ? 0 : column.reshaped(3, column.size() / 3).colwise().norm().maxCoeff();
}

// Makes the answers' parts one after the other.
class NeoHookeanBuilder {
 public:
  NeoHookeanBuilder(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic,
                    NeoHookeanResponseOptions options)
      : preparation_(std::move(preparation)),
        elastic_(elastic),
        options_(std::move(options)),
        centroids_(HandleCentroids(*preparation_)),
        sizes_(*preparation_) {
    AnswerNumbers& numbers = answers_.numbers;
    numbers.model = static_cast<double>(AnswerModel::kNeoHookean);
    numbers.tolerance_mm = options_.tolerance_mm;
    numbers.max_rotation_rad = options_.max_rotation_rad;
    numbers.max_estimate_mm = options_.max_estimate_mm;
    answers_.origins.assign(elastic_.origin().begin(), elastic_.origin().end());
    for (const Eigen::Vector3d& centroid : centroids_) {
      answers_.centroids.insert(answers_.centroids.end(), centroid.begin(), centroid.end());
    }
  }

  absl::StatusOr<std::unique_ptr<VertexResponse>> Build(const std::vector<int32_t>& vertices,
                                                        const Cancellation& cancellation) {
    const Positions& rest = preparation_->mesh().positions();
    const std::vector<int32_t> free =
        DescribeVertices(rest, preparation_->constraints(), vertices, &answers_);
    TF_ASSIGN_OR_RETURN(
        NeoHookeanSeries series,
        MakeNeoHookeanSeries(*preparation_, elastic_, free, options_.observer, cancellation));
    answers_.second_lengths = std::move(series.second_lengths);
    answers_.third_lengths = std::move(series.third_lengths);
    DescribeSeries(series.linear, series.columns.middleCols(sizes_.linear, sizes_.pairs),
                   series.columns.rightCols(sizes_.triples),
                   preparation_->mesh().BoundingBoxDiagonal(), &answers_);
    TF_RETURN_IF_ERROR(Calibrate(free, series.columns, cancellation));
    TF_RETURN_IF_ERROR(cancellation.Check());
    Compress(rest(free, Eigen::all), series.columns);
    return std::make_unique<VertexResponse>(std::move(answers_),
                                            static_cast<int>(sizes_.columns()));
  }

 private:
  SeriesTerms Terms(const std::vector<HandlePose>& poses) const {
    return TermsOf(answers_, NumbersOf(answers_, ToAnswerPoses(poses)));
  }
  // Of what the series leaves out, estimated.
  double SeriesMm(const std::vector<HandlePose>& poses) const {
    return SeriesErrorMm(answers_, Terms(poses));
  }

  // Turned for typical poses; what is cut and how many digits are kept is judged by others, of
  // which some move by a sixth of the mesh, as far as that is covered.
  void Compress(const Positions& rest, const Eigen::MatrixXd& columns) {
    constexpr int kTypical = 600;
    constexpr int kTried = 100;  // of each kind
    const double size_mm = preparation_->mesh().BoundingBoxDiagonal();
    PoseRange range{.rotation_rad = options_.max_rotation_rad,
                    .scale_change = 0,
                    .translation_mm = 0.05 * size_mm,
                    .pivot_offset_mm = 0.05 * size_mm};
    ClusterUses uses;
    uses.typical = FactorsOfAll(CoveredSamples(range, kTypical));
    std::vector<std::vector<HandlePose>> tried =
        CoveredSamples({options_.max_rotation_rad / 3, 0, 0.03 * size_mm, 0.02 * size_mm}, kTried);
    range.translation_mm = 0.15 * size_mm;
    range.pivot_offset_mm = 0.15 * size_mm;
    for (std::vector<HandlePose>& poses : CoveredSamples(range, kTried)) {
      tried.push_back(std::move(poses));
    }
    uses.tried = FactorsOfAll(tried);
    uses.room_mm.resize(uses.tried.cols());
    for (size_t s = 0; s < tried.size(); ++s) {
      uses.room_mm[static_cast<Eigen::Index>(s)] =
          options_.tolerance_mm * (1 + SeriesMm(tried[s]) / kEstimateThatDoublesMm);
    }
    ClusterColumns(rest, columns, uses, &answers_);
    MeasureCut(rest, columns, tried, uses.tried);
  }

  // `factors`: of the poses tried.
  void MeasureCut(const Positions& rest, const Eigen::MatrixXd& columns,
                  const std::vector<std::vector<HandlePose>>& tried,
                  const Eigen::MatrixXd& factors) {
    // Of the rest positions and of the sum: single precision's half unit of each.
    constexpr double kRoundings = 2 * 5.97e-8;
    // So many poses read the columns once.
    constexpr Eigen::Index kAtOnce = 20;
    if (rest.rows() == 0) return;
    answers_.numbers.rounding_mm = kRoundings * rest.rowwise().norm().maxCoeff();
    double worst = 0;
    Eigen::MatrixXd exact;
    for (Eigen::Index s = 0; s < factors.cols(); ++s) {
      if (s % kAtOnce == 0) {
        exact = columns * factors.middleCols(s, std::min(kAtOnce, factors.cols() - s));
      }
      const Positions off = EvaluateClusters(answers_, factors.col(s)).cast<double>() - rest -
                            exact.col(s % kAtOnce).reshaped<Eigen::RowMajor>(rest.rows(), 3);
      const double moved = FirstOrderMm(answers_, Terms(tried[static_cast<size_t>(s)]).numbers);
      if (moved > 0) worst = std::max(worst, off.rowwise().norm().maxCoeff() / moved);
    }
    answers_.numbers.cut_per_mm = kCutAllowance * worst;
  }

  // Samples that are not covered are made smaller until they are: poses beyond are never evaluated.
  std::vector<std::vector<HandlePose>> CoveredSamples(const PoseRange& range, int count) const {
    constexpr double kSmaller = 0.8;
    std::vector<std::vector<HandlePose>> samples = SamplePoses(centroids_, range, count);
    for (std::vector<HandlePose>& poses : samples) {
      while (SeriesMm(poses) > options_.max_estimate_mm) {
        for (HandlePose& pose : poses) pose = PartOfPose(pose, kSmaller);
      }
    }
    return samples;
  }

  Eigen::VectorXd Factors(const std::vector<HandlePose>& poses) const {
    const std::vector<double> factors = FactorsOf(answers_, ToAnswerPoses(poses)).factors;
    return Eigen::Map<const Eigen::VectorXd>(factors.data(), sizes_.columns());
  }

  Eigen::MatrixXd FactorsOfAll(const std::vector<std::vector<HandlePose>>& samples) const {
    Eigen::MatrixXd factors(sizes_.columns(), static_cast<Eigen::Index>(samples.size()));
    for (size_t s = 0; s < samples.size(); ++s) {
      factors.col(static_cast<Eigen::Index>(s)) = Factors(samples[s]);
    }
    return factors;
  }

  // Against what the model converges to. `columns`: of the free vertices.
  absl::Status Calibrate(const std::vector<int32_t>& free, const Eigen::MatrixXd& columns,
                         const Cancellation& cancellation) {
    if (free.empty()) return absl::OkStatus();  // handles are where their poses put them
    NeoHookeanOptions options;
    options.max_iterations = kMaxCalibrationIterations;
    TF_ASSIGN_OR_RETURN(const std::unique_ptr<Deformer> deformer,
                        CreateNeoHookeanDeformer(preparation_, options, cancellation));
    DeformControl control;
    control.on_progress = [&cancellation](const Deformation& /*so_far*/) {
      return cancellation.Check().ok();
    };
    std::vector<MeasuredSeries> measured;
    for (const std::vector<HandlePose>& poses : CalibrationPoses()) {
      TF_ASSIGN_OR_RETURN(const Deformation converged, deformer->Deform(poses, control));
      TF_RETURN_IF_ERROR(cancellation.Check());
      if (!converged.summary.converged) continue;  // nothing is learnt from it
      const Positions displacements =
          (converged.positions - preparation_->mesh().positions())(free, Eigen::all);
      const double error =
          LargestMove(columns * Factors(poses) - displacements.reshaped<Eigen::RowMajor>());
      measured.push_back({Terms(poses), error});
    }
    CalibrateSeries(measured,
                    kEstimateAllowance +
                        kAllowancePerHandle * static_cast<double>(NumHandles(*preparation_) - 1),
                    &answers_);
    return absl::OkStatus();
  }

  // A small turn, a small move and some of both, since the series does not fall alike for them:
  // 2 mm on a head. So small that converging takes some ten iterations each, and large enough for
  // the third order to stand above the columns' and the search's own errors.
  std::vector<std::vector<HandlePose>> CalibrationPoses() const {
    constexpr int kOfBoth = 3;
    const double turn_rad = std::min(options_.max_rotation_rad, std::numbers::pi / 60);
    const double move_mm = preparation_->mesh().BoundingBoxDiagonal() / 100;
    std::vector<std::vector<HandlePose>> poses = {
        SamplePoses(centroids_, {turn_rad, 0, 0, 0}, 2).back(),
        SamplePoses(centroids_, {0, 0, move_mm, 0}, 2).back()};
    const auto both = SamplePoses(centroids_, {turn_rad, 0, move_mm, 0}, 2 * kOfBoth);
    for (size_t s = 1; s < both.size(); s += 2) poses.push_back(both[s]);  // those at the edge
    return poses;
  }

  const std::shared_ptr<MeshPreparation> preparation_;  // owns elastic_
  const ElasticSystem& elastic_;
  const NeoHookeanResponseOptions options_;
  const std::vector<Eigen::Vector3d> centroids_;
  const SeriesSizes sizes_;
  PortableAnswers answers_;
};

}  // namespace

int64_t NeoHookeanResponseBytes(const MeshPreparation& preparation, Eigen::Index num_vertices) {
  return NeoHookeanSeriesBytes(preparation) +
         ClusteredColumnsBytes(num_vertices, SeriesSizes(preparation).columns());
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
  return NeoHookeanBuilder(preparation, *elastic, options).Build(vertices, cancellation);
}

}  // namespace tissueform
