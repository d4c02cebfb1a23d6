// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/generation/rigid_registration.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace tissueform {
namespace {

// Rounds from point to point come first: they come from farther. Weights by distance come last: far
// from home they would keep what happens to lie near.
constexpr int kPointRounds = 10;
constexpr int kEvenRounds = 40;
constexpr double kRestMm = 1e-5;
// Tukey's weights end at three standard deviations; the factor is that from a median to one.
constexpr double kTukey = 3 * 1.4826;
constexpr double kLeastScaleMm = 0.15;
constexpr double kLeastCosine = 0.3;
constexpr double kMaxScoreMm = 10;
// Of the tangential part: holds points on a surface that could slide, and is 0 at the nearest
// point.
constexpr double kTangentWeight = 1e-3;
// An angle counts as the way of a point so far from the axis.
constexpr double kArmMm = 100;

// Of the distance by which the target stands out, beside all points' weights, and what it may be.
constexpr double kStandsOutPrior = 1e-2;
constexpr double kMostStandsOutMm = 1.5;

// A turn, a translation, and the distance by which the target stands out.
using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Vector7 = Eigen::Matrix<double, 7, 1>;

struct Pairs {
  Positions from;  // moved points
  SurfacePoints to;
  Eigen::VectorXd distances;
  std::vector<bool> faces_alike;
  Eigen::VectorXd weights;
};

struct Place {
  RigidMove move;
  double stands_out_mm = 0;
};

void AddRow(const Eigen::Vector3d& at, const Eigen::Vector3d& direction, double outward,
            double residual, double weight, Matrix7* normal_matrix, Vector7* right) {
  Vector7 row;
  row << at.cross(direction), direction, outward;
  *normal_matrix += weight * row * row.transpose();
  *right -= weight * residual * row;
}

// One Gauss-Newton step towards the planes of the nearest points, which lie `now` mm within the
// target, and to what distance within it they should lie.
Place StepToPlanes(const Pairs& pairs, const RegistrationOptions& options, double now) {
  Matrix7 normal_matrix = Matrix7::Zero();
  Vector7 right = Vector7::Zero();
  const Eigen::RowVector3d center = pairs.from.colwise().mean();
  for (Eigen::Index i = 0; i < pairs.from.rows(); ++i) {
    const double weight = pairs.weights[i];
    if (weight <= 0) continue;
    const Eigen::Vector3d at = pairs.from.row(i) - center;
    const Eigen::Vector3d gap = pairs.from.row(i) - pairs.to.points.row(i);
    const Eigen::Vector3d normal = pairs.to.normals.row(i);
    AddRow(at, normal, 1, gap.dot(normal), weight, &normal_matrix, &right);
    for (int axis = 0; axis < 3; ++axis) {
      AddRow(at, Eigen::Vector3d::Unit(axis), 0, gap[axis], kTangentWeight * weight, &normal_matrix,
             &right);
    }
  }
  Vector7 step = Vector7::Zero();
  if (options.target_stands_out) {
    const double prior = kStandsOutPrior * pairs.weights.sum();
    normal_matrix(6, 6) += prior;
    right[6] -= prior * now;
    step = normal_matrix.ldlt().solve(right);
  } else {
    step.head<6>() = normal_matrix.topLeftCorner<6, 6>().ldlt().solve(right.head<6>());
  }
  const Eigen::Vector3d turn = step.head<3>();
  RigidMove move;
  if (turn.norm() > 0) {
    move.rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  }
  move.translation_mm =
      center.transpose() + step.segment<3>(3) - move.rotation * center.transpose();
  return {move, std::clamp(now + step[6], -kMostStandsOutMm, kMostStandsOutMm)};
}

// The largest distance that counts: that of the share to keep, among the points that face alike.
double LimitOf(const Pairs& pairs, double keep) {
  std::vector<double> kept;
  for (Eigen::Index i = 0; i < pairs.distances.size(); ++i) {
    if (pairs.faces_alike[static_cast<size_t>(i)]) kept.push_back(pairs.distances[i]);
  }
  const auto last = static_cast<size_t>(keep * static_cast<double>(pairs.distances.size()));
  if (kept.size() <= last) return INFINITY;
  std::ranges::nth_element(kept, kept.begin() + static_cast<std::ptrdiff_t>(last));
  return kept[last];
}

double MedianUpTo(const Pairs& pairs, double limit_mm) {
  std::vector<double> used;
  for (Eigen::Index i = 0; i < pairs.distances.size(); ++i) {
    if (pairs.faces_alike[static_cast<size_t>(i)] && pairs.distances[i] <= limit_mm) {
      used.push_back(pairs.distances[i]);
    }
  }
  if (used.empty()) return 0;
  const auto middle = used.begin() + static_cast<std::ptrdiff_t>(used.size() / 2);
  std::ranges::nth_element(used, middle);
  return *middle;
}

void Weigh(const RegistrationOptions& options, bool by_distance, Pairs* pairs) {
  const double limit_mm = LimitOf(*pairs, options.keep);
  const double scale_mm = std::max(kLeastScaleMm, kTukey * MedianUpTo(*pairs, limit_mm));
  pairs->weights.setZero(pairs->distances.size());
  for (Eigen::Index i = 0; i < pairs->distances.size(); ++i) {
    const double part = pairs->distances[i] / scale_mm;
    if (!pairs->faces_alike[static_cast<size_t>(i)] || pairs->distances[i] > limit_mm) continue;
    const double rest = 1 - part * part;
    if (!by_distance) pairs->weights[i] = 1;
    if (by_distance && rest > 0) pairs->weights[i] = rest * rest;
  }
  // Nothing faces alike: far from home, any point is better than none.
  if (pairs->weights.maxCoeff() <= 0) pairs->weights.setOnes();
}

Pairs Paired(const NearestPoints& nearest, const OrientedPoints& points, const Place& place,
             const RegistrationOptions& options) {
  Pairs pairs{.from = Moved(points.points, place.move),
              .to = {},
              .distances = {},
              .faces_alike = {},
              .weights = {}};
  pairs.to = nearest.WithNormals(pairs.from);
  pairs.to.points -= place.stands_out_mm * pairs.to.normals;
  pairs.distances = (pairs.from - pairs.to.points).rowwise().norm();
  const Positions normals = points.normals * place.move.rotation.transpose();
  for (Eigen::Index i = 0; i < normals.rows(); ++i) {
    pairs.faces_alike.push_back(!options.compare_normals ||
                                normals.row(i).dot(pairs.to.normals.row(i)) > kLeastCosine);
  }
  return pairs;
}

double ScoreOf(const Pairs& pairs) {
  double sum = 0;
  for (Eigen::Index i = 0; i < pairs.distances.size(); ++i) {
    sum += pairs.faces_alike[static_cast<size_t>(i)] ? std::min(kMaxScoreMm, pairs.distances[i])
                                                     : kMaxScoreMm;
  }
  return sum / static_cast<double>(pairs.distances.size());
}

Registration Measured(const Pairs& pairs, const Place& place) {
  const Eigen::ArrayXd used = (pairs.weights.array() > 0).cast<double>();
  const Eigen::ArrayXd squares = pairs.distances.array().square();
  return {.move = place.move,
          .rms_mm = std::sqrt((used * squares).sum() / std::max(1.0, used.sum())),
          .all_rms_mm = std::sqrt(squares.mean()),
          .share = used.mean(),
          .stands_out_mm = place.stands_out_mm,
          .score_mm = ScoreOf(pairs)};
}

double WayOf(const RigidMove& step, const Eigen::Vector3d& center) {
  const double turn = Eigen::AngleAxisd(step.rotation).angle();
  return (step(center) - center).norm() + kArmMm * std::abs(turn);
}

}  // namespace

OrientedPoints SampleTriangles(const TriangleMesh& mesh, Eigen::Index count) {
  count = std::min(count, mesh.num_triangles());
  OrientedPoints sample{.points = Positions(count, 3), .normals = Positions(count, 3)};
  Eigen::Index used = 0;
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto t = mesh.triangles().row(i * mesh.num_triangles() / count);
    const Eigen::Vector3d a = mesh.positions().row(t[0]);
    const Eigen::Vector3d b = mesh.positions().row(t[1]);
    const Eigen::Vector3d c = mesh.positions().row(t[2]);
    const Eigen::Vector3d normal = (b - a).cross(c - a);
    if (normal.norm() <= 0) continue;
    sample.points.row(used) = (a + b + c) / 3;
    sample.normals.row(used++) = normal.normalized();
  }
  sample.points.conservativeResize(used, 3);
  sample.normals.conservativeResize(used, 3);
  return sample;
}

SurfaceRegistration::SurfaceRegistration(const TriangleMesh& target) : nearest_(target) {}

Registration SurfaceRegistration::Refine(const OrientedPoints& points, const RigidMove& start,
                                         const RegistrationOptions& options) const {
  Place place{.move = start};
  const bool robust = options.compare_normals;
  for (int round = 0; round < options.max_rounds; ++round) {
    Pairs pairs = Paired(nearest_, points, place, options);
    const bool to_planes = round >= kPointRounds;
    const bool by_distance = robust && round >= kEvenRounds;
    Weigh(options, by_distance, &pairs);
    const double before = place.stands_out_mm;
    const Place step = to_planes
                           ? StepToPlanes(pairs, options, before)
                           : Place{MoveOnto(pairs.from, pairs.to.points, pairs.weights), before};
    const Eigen::Vector3d center = pairs.from.colwise().mean();
    place = {Composed(step.move, place.move), step.stands_out_mm};
    place.move.rotation = NearestRotation(place.move.rotation);
    const double way = WayOf(step.move, center) + std::abs(place.stands_out_mm - before);
    if (to_planes && by_distance == robust && way < kRestMm) break;
  }
  Pairs pairs = Paired(nearest_, points, place, options);
  Weigh(options, robust, &pairs);
  return Measured(pairs, place);
}

}  // namespace tissueform
