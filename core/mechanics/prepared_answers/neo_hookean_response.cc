// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/neo_hookean_response.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/neo_hookean_deformer.h"
#include "core/mechanics/elasticity/neo_hookean_expansion.h"
#include "core/mechanics/prepared_answers/chosen_vertices.h"
#include "core/mechanics/prepared_answers/clustered_columns.h"
#include "core/mechanics/prepared_answers/neo_hookean_series.h"
#include "core/mechanics/prepared_answers/pose_numbers.h"
#include "core/mechanics/prepared_answers/pose_samples.h"
#include "core/mechanics/prepared_answers/series_estimate.h"

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

class NeoHookeanResponse : public VertexResponse {
 public:
  NeoHookeanResponse(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic,
                     ChosenVertices chosen, NeoHookeanResponseOptions options)
      : preparation_(std::move(preparation)),
        elastic_(elastic),
        options_(std::move(options)),
        chosen_(std::move(chosen)),
        centroids_(HandleCentroids(*preparation_)),
        sizes_(*preparation_) {}

  // `free`: those of the chosen vertices.
  absl::Status Prepare(const std::vector<int32_t>& free, const Cancellation& cancellation) {
    TF_ASSIGN_OR_RETURN(
        NeoHookeanSeries series,
        MakeNeoHookeanSeries(*preparation_, elastic_, free, options_.observer, cancellation));
    damping_ = std::move(series.damping);
    estimate_.emplace(series.linear, series.columns.middleCols(sizes_.linear, sizes_.pairs),
                      series.columns.rightCols(sizes_.triples),
                      preparation_->mesh().BoundingBoxDiagonal());
    TF_RETURN_IF_ERROR(Calibrate(free, series.columns, cancellation));
    TF_RETURN_IF_ERROR(cancellation.Check());
    Compress(preparation_->mesh().positions()(free, Eigen::all), series.columns);
    return absl::OkStatus();
  }

  double ErrorBoundMm(absl::Span<const HandlePose> poses) const override {
    return UseOf(poses).error_mm;
  }
  bool error_is_estimate() const override { return true; }

  bool Covers(absl::Span<const HandlePose> poses) const override {
    return InRange(poses) && ErrorBoundMm(poses) <= options_.max_estimate_mm;
  }

  void Evaluate(absl::Span<const HandlePose> poses, FloatPositions* positions) const override {
    Write(poses, UseOf(poses), positions);
  }

  std::optional<double> Answer(absl::Span<const HandlePose> poses,
                               FloatPositions* positions) const override {
    if (!InRange(poses)) return std::nullopt;
    const Use use = UseOf(poses);
    if (!(use.error_mm <= options_.max_estimate_mm)) return std::nullopt;
    Write(poses, use, positions);
    return use.error_mm;
  }

  PortableAnswers Describe() const override {
    PortableAnswers answers;
    chosen_.Describe(&answers);
    columns_->Describe(&answers);
    estimate_->Describe(&answers);
    if (damping_) damping_->Describe(&answers);
    AnswerNumbers& numbers = answers.numbers;
    numbers.model = static_cast<double>(AnswerModel::kNeoHookean);
    numbers.tolerance_mm = options_.tolerance_mm;
    numbers.max_rotation_rad = options_.max_rotation_rad;
    numbers.max_estimate_mm = options_.max_estimate_mm;
    numbers.cut_per_mm = cut_per_mm_;
    numbers.rounding_mm = rounding_mm_;
    answers.origins.assign(elastic_.origin().begin(), elastic_.origin().end());
    for (const Eigen::Vector3d& centroid : centroids_) {
      answers.centroids.insert(answers.centroids.end(), centroid.begin(), centroid.end());
    }
    return answers;
  }

  Eigen::Index num_vertices() const override { return chosen_.size(); }
  int num_terms() const override { return static_cast<int>(columns_->num_columns()); }
  int num_terms_before() const override { return static_cast<int>(columns_->num_columns_before()); }
  int64_t bytes_held() const override {
    return columns_->bytes_held() + chosen_.bytes_held() + estimate_->bytes_held() +
           (damping_ ? damping_->bytes_held() : 0);
  }

 private:
  // What the columns are multiplied with, and what that leaves out.
  struct Use {
    SeriesEstimate::Terms terms;
    Eigen::VectorXd factors;
    double series_mm = 0;  // estimated
    double error_mm = 0;   // with what was cut of the columns, and rounding
  };

  Use UseOf(absl::Span<const HandlePose> poses) const {
    const Eigen::VectorXd numbers = PoseNumbers(poses, centroids_);
    Use use;
    use.terms.pairs = PairProducts(numbers);
    use.factors.resize(sizes_.columns());
    use.factors.head(sizes_.linear + sizes_.pairs) << elastic_.Coefficients(poses), use.terms.pairs;
    if (damping_) {
      use.terms.triples = TripleProducts(numbers);
      use.terms.ratio = damping_->Ratio(use.terms.pairs, use.terms.triples);
      use.factors.tail(sizes_.triples) = use.terms.triples / (1 + use.terms.ratio);
    }
    use.series_mm = estimate_->Mm(use.terms);
    use.error_mm =
        std::max(use.series_mm + rounding_mm_ + cut_per_mm_ * estimate_->FirstOrderMm(numbers),
                 chosen_.RoundingBoundMm(poses));
    return use;
  }

  void Write(absl::Span<const HandlePose> poses, const Use& use, FloatPositions* positions) const {
    positions->resize(chosen_.size(), 3);
    columns_->Evaluate(use.factors, positions);
    chosen_.Complete(poses, positions);
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
    ClusteredColumns::Uses uses;
    uses.typical = FactorsOf(CoveredSamples(range, kTypical));
    std::vector<std::vector<HandlePose>> tried =
        CoveredSamples({options_.max_rotation_rad / 3, 0, 0.03 * size_mm, 0.02 * size_mm}, kTried);
    range.translation_mm = 0.15 * size_mm;
    range.pivot_offset_mm = 0.15 * size_mm;
    for (std::vector<HandlePose>& poses : CoveredSamples(range, kTried)) {
      tried.push_back(std::move(poses));
    }
    uses.tried = FactorsOf(tried);
    uses.room_mm.resize(uses.tried.cols());
    for (size_t s = 0; s < tried.size(); ++s) {
      uses.room_mm[static_cast<Eigen::Index>(s)] =
          options_.tolerance_mm * (1 + UseOf(tried[s]).series_mm / kEstimateThatDoublesMm);
    }
    columns_.emplace(rest, columns, uses);
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
    rounding_mm_ = kRoundings * rest.rowwise().norm().maxCoeff();
    double worst = 0;
    FloatPositions answer;
    Eigen::MatrixXd exact;
    for (Eigen::Index s = 0; s < factors.cols(); ++s) {
      if (s % kAtOnce == 0) {
        exact = columns * factors.middleCols(s, std::min(kAtOnce, factors.cols() - s));
      }
      columns_->Evaluate(factors.col(s), &answer);
      const Positions off = answer.cast<double>() - rest -
                            exact.col(s % kAtOnce).reshaped<Eigen::RowMajor>(rest.rows(), 3);
      const double moved =
          estimate_->FirstOrderMm(PoseNumbers(tried[static_cast<size_t>(s)], centroids_));
      if (moved > 0) worst = std::max(worst, off.rowwise().norm().maxCoeff() / moved);
    }
    cut_per_mm_ = kCutAllowance * worst;
  }

  // Those that are not covered are made smaller until they are: nobody asks for the rest.
  std::vector<std::vector<HandlePose>> CoveredSamples(const PoseRange& range, int count) const {
    constexpr double kSmaller = 0.8;
    std::vector<std::vector<HandlePose>> samples = SamplePoses(centroids_, range, count);
    for (std::vector<HandlePose>& poses : samples) {
      while (UseOf(poses).series_mm > options_.max_estimate_mm) {
        for (HandlePose& pose : poses) pose = PartOfPose(pose, kSmaller);
      }
    }
    return samples;
  }

  Eigen::MatrixXd FactorsOf(const std::vector<std::vector<HandlePose>>& samples) const {
    Eigen::MatrixXd factors(sizes_.columns(), static_cast<Eigen::Index>(samples.size()));
    for (size_t s = 0; s < samples.size(); ++s) {
      factors.col(static_cast<Eigen::Index>(s)) = UseOf(samples[s]).factors;
    }
    return factors;
  }

  bool InRange(absl::Span<const HandlePose> poses) const {
    constexpr double kSlack = 1 + 1e-9;  // the edge of the range belongs to it
    return std::all_of(poses.begin(), poses.end(), [this](const HandlePose& pose) {
      return pose.rotation_vector.norm() <= options_.max_rotation_rad * kSlack && pose.scale == 1;
    });
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
    std::vector<SeriesEstimate::Measured> measured;
    for (const std::vector<HandlePose>& poses : CalibrationPoses()) {
      TF_ASSIGN_OR_RETURN(const Deformation converged, deformer->Deform(poses, control));
      TF_RETURN_IF_ERROR(cancellation.Check());
      if (!converged.summary.converged) continue;  // nothing is learnt from it
      Use use = UseOf(poses);
      const Positions displacements =
          (converged.positions - preparation_->mesh().positions())(free, Eigen::all);
      const double error =
          LargestMove(columns * use.factors - displacements.reshaped<Eigen::RowMajor>());
      measured.push_back({std::move(use.terms), error});
    }
    estimate_->Calibrate(
        measured, kEstimateAllowance +
                      kAllowancePerHandle * static_cast<double>(NumHandles(*preparation_) - 1));
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

  // Constant after Prepare.
  const std::shared_ptr<MeshPreparation> preparation_;  // owns elastic_
  const ElasticSystem& elastic_;
  const NeoHookeanResponseOptions options_;
  const ChosenVertices chosen_;
  const std::vector<Eigen::Vector3d> centroids_;
  const SeriesSizes sizes_;
  std::optional<ThirdOrderDamping> damping_;  // where there is a third order
  std::optional<SeriesEstimate> estimate_;
  std::optional<ClusteredColumns> columns_;
  double cut_per_mm_ = 0;  // of the first order
  double rounding_mm_ = 0;
};

}  // namespace

int64_t NeoHookeanResponseBytes(const MeshPreparation& preparation, Eigen::Index num_vertices) {
  return NeoHookeanSeriesBytes(preparation) +
         ClusteredColumns::BytesNeeded(num_vertices, SeriesSizes(preparation).columns());
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
  ChosenVertices chosen(preparation->mesh().positions(), preparation->constraints(), vertices);
  const std::vector<int32_t> free = chosen.FreeAmong(vertices);
  auto response =
      std::make_unique<NeoHookeanResponse>(preparation, *elastic, std::move(chosen), options);
  TF_RETURN_IF_ERROR(response->Prepare(free, cancellation));
  return response;
}

}  // namespace tissueform
