// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/mouth_line.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/grid_operations.h"

namespace tissueform {
namespace {

using Eigen::Index;

// Constants are of adults' anatomy or of what a CT can show. Changed by a quarter, they move the
// lines of two heads with closed lips by 1.5 mm at most.

// One place in five may be hidden, by a hair or a scar, without a doubt about the rest.
constexpr double kSureShare = 0.8;
// Limits of a line that a person gives.
constexpr double kGivenStepMm = 0.5;
constexpr double kGivenHalfWidthMm = 45;
constexpr double kGivenHeightMm = 25;

// The red of a lip is about 8 mm high: the lip's foremost skin is no farther from the line.
constexpr double kLipHeightMm = 8;
// Closed lips are rounded over less than that. A deeper notch says no more about where they meet.
constexpr double kDeepNotchMm = 6;
// The edge of a lip over a gap: the relief falls or rises by so much within 2 mm, steeper than a
// closed notch and even where a CT blurs it. Edges nearer to each other than two voxels of a coarse
// grid are the two sides of a closed notch.
constexpr double kLipEdgeMm = 3;
constexpr double kLipEdgeHeightMm = 2;
constexpr double kNarrowestGapMm = 4;
// Lips are about that thick. Deeper behind them, it does not matter what a ray meets: teeth, tongue
// or throat.
constexpr double kInMouthMm = 11;
// How far below the start a lower lip is searched for. A mouth that is opened wider is unsure.
constexpr double kFallenJawMm = 30;
// How far over the start no nose reaches: the start is 3 mm over the incisors' edges, and a nose
// begins 20 to 25 mm over these.
constexpr double kBelowNoseMm = 12;

// A notch that is 1 mm deeper is worth a detour of 2 mm; no mouth is steeper than 45 degrees.
constexpr double kCostOfStep = 0.5;
constexpr int kMaxStepRows = 2;

// Skin is not steeper than 3 mm from column to column; hairs and the edges of a gap are.
constexpr double kSameSkinMm = 3;

// Adult mouths are 40 to 60 mm wide. A notch that ends nearer to the midline than half of the
// narrowest is hidden by hair or too shallow to see; its corner is put at half of the usual width.
constexpr double kNarrowestHalfMm = 20;
constexpr double kUsualHalfMm = 25;
// Single hairs, scars and the CT's noise are narrower than the median over 2 mm to either side.
constexpr Index kSmoothColumns = 2;
// A breathing tube is 10 to 13 mm thick: a lip that is hidden within half of that of the end of a
// notch may hide the true end.
constexpr double kHalfTubeMm = 6;

constexpr double kOverIncisorMm = 3;  // where the lips of most adults at rest meet
constexpr double kEnamelHu = 1400;    // bone of a ridge without teeth stays below
constexpr double kNearIncisorMm = 4;  // half of a front tooth's width
constexpr double kNearMetalMm = 25;   // from a front tooth to the skin, and its streaks farther on

// A relief of what lies about a mouth, with room for the lips of a fallen jaw and wide noses.
constexpr double kReliefHalfWidthMm = kMouthHalfWidthCapMm + 5;
constexpr double kReliefFrontMm = 40;
constexpr double kReliefDepthMm = 90;

// kUnclear: one lip ends at a gap, but the relief does not show where the other one begins.
enum class Seen { kSkin, kGap, kUnclear, kNothing };

// What a relief shows at a place, as to lips.
struct Notch {
  Seen seen = Seen::kNothing;
  double depth_mm = 0;
};

// A mean with the neighboring columns, where they show the same skin.
FaceRelief SmoothAlongLeft(const FaceRelief& relief) {
  FaceRelief smooth = relief;
  const Index last = relief.front_mm.cols() - 1;
  for (Index column = 0; column <= last; ++column) {
    for (Index row = 0; row < relief.front_mm.rows(); ++row) {
      const double front = relief.front_mm(row, column);
      double sum = 2 * front;
      double weight = 2;
      for (const Index other : {std::max<Index>(column - 1, 0), std::min(column + 1, last)}) {
        const double beside = relief.front_mm(row, other);
        // False for infinities and NaN, which stay as they are.
        if (!(std::abs(beside - front) < kSameSkinMm)) continue;
        sum += beside;
        weight += 1;
      }
      smooth.front_mm(row, column) = sum / weight;
    }
  }
  return smooth;
}

// One column of the relief.
class LipColumn {
 public:
  LipColumn(const FaceRelief& relief, Index column, double start_up)
      : relief_(relief), column_(column) {
    const Index fallen = RowAt(start_up - kFallenJawMm);
    notch_low_ = RowAt(start_up - kMouthLineSearchMm);
    below_nose_ = RowAt(start_up + kBelowNoseMm);
    foremost_ = Foremost(fallen, below_nose_);
    FindGap(fallen, RowAt(start_up + kMouthLineSearchMm));
  }

  Index RowAt(double up) const {
    const double row = (up - relief_.bottom_mm) / relief_.row_mm;
    return std::clamp<Index>(std::lround(row), 0, relief_.front_mm.rows() - 1);
  }
  double Front(Index row) const { return relief_.front_mm(row, column_); }

  Notch At(Index row) const {
    if (std::isnan(Front(row)) || !std::isfinite(foremost_)) return {};
    if (column_seen_ == Seen::kGap) return {Seen::kGap, 0};
    const double depth_mm = BelowChord(row);
    // False for infinities, too.
    const bool is_skin = column_seen_ == Seen::kSkin && depth_mm < kInMouthMm;
    return is_skin ? Notch{Seen::kSkin, depth_mm} : Notch{Seen::kUnclear, 0};
  }
  // What a path is worth that goes through a row.
  double GainAt(Index row) const {
    const Notch notch = At(row);
    if (notch.seen == Seen::kGap) {
      return kDeepNotchMm - relief_.row_mm * std::abs(static_cast<double>(row) - gap_middle());
    }
    return row < notch_low_ ? 0 : std::min(notch.depth_mm, kDeepNotchMm);
  }
  // The point of the line at a row, on the skin as measured; at a gap, midway between its edges and
  // no farther back than the lips.
  MouthLinePoint PointAt(Index row, const FaceRelief& measured) const {
    const Notch notch = At(row);
    MouthLinePoint point;
    point.at = {relief_.LeftOf(column_), measured.front_mm(row, column_), relief_.UpOf(row)};
    point.notch_mm = notch.depth_mm;
    point.parted = notch.seen == Seen::kGap;
    if (point.parted) {
      point.at.up = relief_.bottom_mm + gap_middle() * relief_.row_mm;
      point.at.front = LipsFront(static_cast<Index>(std::ceil(gap_low_)),
                                 static_cast<Index>(std::floor(gap_high_)));
    } else if (notch.seen != Seen::kSkin) {
      point.at.front = LipsFront(row, row);
    }
    return point;
  }

 private:
  struct Edge {
    double rise_mm = 0;
    double row = 0;
  };

  double gap_middle() const { return (gap_low_ + gap_high_) / 2; }
  Index RowsOf(double mm) const { return std::lround(mm / relief_.row_mm); }
  double Lip(Index row) const {
    return std::isnan(Front(row)) ? Front(row) : std::max(Front(row), lip_floor_);
  }

  // The steepest edge between two rows. `sign` is +1 for one that rises upwards, -1 for one that
  // falls.
  Edge SteepestEdge(Index first, Index last, int sign) const {
    const Index height = RowsOf(kLipEdgeHeightMm);
    Edge edge;
    for (Index row = first; row + height <= last; ++row) {
      const double rise_mm = sign * (Lip(row + height) - Lip(row));
      // At a tie the place nearer to the gap, for both lips, so that the line stays midway.
      const bool is_nearer = sign < 0 && rise_mm == edge.rise_mm && rise_mm > 0;
      if (!(rise_mm > edge.rise_mm) && !is_nearer) continue;
      edge = {rise_mm, HalfHeight(row, row + height)};
    }
    return edge;
  }
  // Where the relief crosses the mean of its values at two rows.
  double HalfHeight(Index low, Index high) const {
    const double half = (Lip(low) + Lip(high)) / 2;
    for (Index row = low; row < high; ++row) {
      const double from = Lip(row) - half;
      const double to = Lip(row + 1) - half;
      if (from * to <= 0 && from != to) return static_cast<double>(row) + from / (from - to);
    }
    return static_cast<double>(low + high) / 2;
  }
  // The upper lip ends within the rows of the search; the lower one begins above `fallen`.
  void FindGap(Index fallen, Index high) {
    lip_floor_ = Foremost(notch_low_, below_nose_) - kInMouthMm;
    const Edge upper = SteepestEdge(notch_low_, high, 1);
    if (upper.rise_mm < kLipEdgeMm) return;
    const Edge lower = SteepestEdge(fallen, static_cast<Index>(upper.row), -1);
    gap_low_ = lower.row;
    gap_high_ = upper.row;
    const bool is_clear = lower.rise_mm >= kLipEdgeMm;
    const bool is_closed = is_clear ? gap_high_ - gap_low_ < kNarrowestGapMm / relief_.row_mm
                                    : IsClosedBelow(static_cast<Index>(upper.row));
    if (is_closed) return;
    column_seen_ = is_clear ? Seen::kGap : Seen::kUnclear;
  }
  // Whether the notch under an upper lip's edge is that of lips that touch, as where the upper one
  // overhangs: it is not deep, and under it the skin comes forward again.
  bool IsClosedBelow(Index edge) const {
    Index bottom = edge;
    for (Index row = std::max<Index>(edge - LipRows(), 0); row <= edge; ++row) {
      if (!(BelowChord(row) < kDeepNotchMm)) return false;
      if (Front(row) < Front(bottom)) bottom = row;
    }
    return Foremost(bottom - LipRows(), bottom) - Front(bottom) >= kShallowNotchMm;
  }

  // How far the skin lies behind the chord from the front of the lip above to the one below.
  double BelowChord(Index row) const {
    const Index above = ForemostRow(row, std::min(row + LipRows(), below_nose_));
    const Index below = ForemostRow(row - LipRows(), row);
    if (above == row || below == row) return 0;
    const double share = static_cast<double>(row - below) / static_cast<double>(above - below);
    return (1 - share) * Front(below) + share * Front(above) - Front(row);
  }
  // Infinities and NaN do not count.
  Index ForemostRow(Index first, Index last) const {
    first = std::max<Index>(first, 0);
    Index foremost = first;
    for (Index row = first; row <= std::min(last, relief_.front_mm.rows() - 1); ++row) {
      if (Front(row) > Front(foremost) || !std::isfinite(Front(foremost))) foremost = row;
    }
    return foremost;
  }
  double Foremost(Index first, Index last) const {
    const double front = Front(ForemostRow(first, last));
    return std::isfinite(front) ? front : -std::numeric_limits<double>::infinity();
  }
  Index LipRows() const { return RowsOf(kLipHeightMm); }
  // Of the lip farther back; of the nearest skin where a lip is not seen.
  double LipsFront(Index low, Index high) const {
    const double front = std::min(Foremost(low - LipRows(), low), Foremost(high, high + LipRows()));
    return std::isfinite(front) ? front : NearestFront(low);
  }
  double NearestFront(Index row) const {
    for (Index away = 1; away < relief_.front_mm.rows(); ++away) {
      const double front = Foremost(row - away, row + away);
      if (std::isfinite(front)) return front;
    }
    return 0;
  }

  const FaceRelief& relief_;
  Index column_;
  double foremost_ = 0;
  Index notch_low_ = 0;
  Index below_nose_ = 0;
  Seen column_seen_ = Seen::kSkin;
  double lip_floor_ = 0;
  double gap_low_ = 0;  // rows of the edges of the lips
  double gap_high_ = 0;
};

// Rows of the columns from `first` on, along the best path.
class PathSearch {
 public:
  PathSearch(const std::vector<LipColumn>& columns, Index low_row, Index num_rows, double row_mm)
      : columns_(columns),
        low_row_(low_row),
        cost_of_row_(kCostOfStep * row_mm),
        from_(num_rows, static_cast<Index>(columns.size())),
        best_(Eigen::ArrayXd::Zero(num_rows)) {}

  std::vector<Index> Run() {
    for (Index column = 0; column < from_.cols(); ++column) Extend(column);
    std::vector<Index> rows(columns_.size());
    Index row = 0;
    best_.maxCoeff(&row);
    for (Index column = from_.cols() - 1; column >= 0; --column) {
      rows[static_cast<size_t>(column)] = low_row_ + row;
      row = from_(row, column);
    }
    return rows;
  }

 private:
  void Extend(Index column) {
    const Eigen::ArrayXd before = best_;
    for (Index row = 0; row < best_.size(); ++row) {
      double best = -std::numeric_limits<double>::infinity();
      const Index last = std::min(row + kMaxStepRows, best_.size() - 1);
      for (Index other = std::max<Index>(row - kMaxStepRows, 0); other <= last; ++other) {
        const double score =
            before[other] - cost_of_row_ * static_cast<double>(std::abs(row - other));
        // At a tie the straight way, so that a line without a notch stays level.
        const bool straighter = score == best && other == row;
        if (!(score > best) && !straighter) continue;
        best = score;
        from_(row, column) = other;
      }
      best_[row] = best + columns_[static_cast<size_t>(column)].GainAt(low_row_ + row);
    }
  }

  const std::vector<LipColumn>& columns_;
  Index low_row_;
  double cost_of_row_;
  Eigen::Array<Index, Eigen::Dynamic, Eigen::Dynamic> from_;
  Eigen::ArrayXd best_;
};

// A point of one half of the line.
struct HalfPoint {
  size_t index = 0;
  double out_mm = 0;    // from the midline
  double notch_mm = 0;  // smoothed along the line; parted lips count as deep
  Seen seen = Seen::kNothing;
};
using HalfLine = std::vector<HalfPoint>;  // from the midline outwards

double SmoothNotch(const std::vector<MouthLinePoint>& points, size_t index) {
  const auto middle = static_cast<Index>(index);
  const Index last = std::min(middle + kSmoothColumns, static_cast<Index>(points.size()) - 1);
  std::vector<double> depths;
  for (Index i = std::max<Index>(middle - kSmoothColumns, 0); i <= last; ++i) {
    const MouthLinePoint& point = points[static_cast<size_t>(i)];
    depths.push_back(point.parted ? kDeepNotchMm : point.notch_mm);
  }
  const auto median = depths.begin() + static_cast<Index>(depths.size() / 2);
  std::nth_element(depths.begin(), median, depths.end());
  return *median;
}

// The half to the left for `side` +1, to the right for -1.
HalfLine HalfOf(const std::vector<MouthLinePoint>& points, const std::vector<Seen>& seen,
                int side) {
  HalfLine half;
  for (size_t i = 0; i < points.size(); ++i) {
    if (side * points[i].at.left < 0) continue;
    half.push_back({i, std::abs(points[i].at.left), SmoothNotch(points, i), seen[i]});
  }
  if (side < 0) std::reverse(half.begin(), half.end());
  return half;
}

struct CornerFound {
  size_t index = 0;
  MouthCornerReason reason = MouthCornerReason::kCapped;
};

// Whether the notch of `half` ends before `end` beyond doubt.
bool EndsClearly(const HalfLine& half, HalfLine::const_iterator end) {
  const HalfPoint& corner = *std::prev(end);
  const bool is_hidden = std::any_of(half.begin(), half.end(), [&](const HalfPoint& point) {
    return point.seen == Seen::kUnclear && std::abs(point.out_mm - corner.out_mm) < kHalfTubeMm;
  });
  const auto deep = std::count_if(
      half.begin(), end, [](const HalfPoint& point) { return point.notch_mm >= kShallowNotchMm; });
  return corner.out_mm >= kNarrowestHalfMm && !is_hidden &&
         static_cast<double>(deep) >= kSureShare * static_cast<double>(end - half.begin());
}

CornerFound FindCorner(const HalfLine& half) {
  const auto unseen = std::find_if(half.begin(), half.end(), [](const HalfPoint& point) {
    return point.seen == Seen::kNothing;
  });
  const auto cut_reason =
      unseen == half.end() ? MouthCornerReason::kCapped : MouthCornerReason::kSkinNotSeen;
  const auto end = std::find_if(half.begin(), unseen, [](const HalfPoint& point) {
    return point.out_mm >= kNarrowestHalfMm && point.notch_mm < kShallowNotchMm;
  });
  if (end == unseen) return {std::prev(unseen)->index, cut_reason};
  if (EndsClearly(half, end)) return {std::prev(end)->index, MouthCornerReason::kNotchEnds};
  const auto usual = std::find_if(
      half.begin(), unseen, [](const HalfPoint& point) { return point.out_mm >= kUsualHalfMm; });
  if (usual == unseen) return {std::prev(unseen)->index, cut_reason};
  return {usual->index, MouthCornerReason::kNoNotch};
}

void KeepBetweenCorners(const std::vector<Seen>& seen, MouthLine* line) {
  const CornerFound right = FindCorner(HalfOf(line->points, seen, -1));
  const CornerFound left = FindCorner(HalfOf(line->points, seen, 1));
  line->right_corner = right.reason;
  line->left_corner = left.reason;
  const auto first = line->points.begin();
  line->points = {first + static_cast<int64_t>(right.index),
                  first + static_cast<int64_t>(left.index) + 1};
  const auto share = [line](auto counts) {
    const auto count = std::count_if(line->points.begin(), line->points.end(), counts);
    return static_cast<double>(count) / static_cast<double>(line->points.size());
  };
  line->seen_share = share([](const MouthLinePoint& point) { return point.seen(); });
  line->parted_share = share([](const MouthLinePoint& point) { return point.parted; });
}

bool ShowsTooth(const HeadSegmentation& head, const Eigen::Vector3d& incisor) {
  const double reach_mm = std::max(kNearIncisorMm, 2 * head.hu.geometry.spacing_mm);
  bool shows = false;
  ForEachVoxel(head.bone, [&](size_t index, const Eigen::Vector3d& place) {
    if ((place - incisor).norm() > reach_mm) return;
    const bool is_metal = !head.metal.values.empty() && head.metal.values[index] != 0;
    shows |= is_metal || head.hu.values[index] > kEnamelHu;
  });
  return shows;
}

bool IsNearMetal(const HeadSegmentation& head, const FaceAxes& axes, const MouthLine& line) {
  std::vector<Eigen::Vector3d> places;
  for (const MouthLinePoint& point : line.points) places.push_back(axes.Place(point.at));
  bool is_near = false;
  ForEachVoxel(head.metal, [&](size_t, const Eigen::Vector3d& metal) {
    is_near = is_near || std::any_of(places.begin(), places.end(), [&](const auto& place) {
                return (place - metal).norm() < kNearMetalMm;
              });
  });
  return is_near;
}

std::string DescribeCorner(const char* side, MouthCornerReason reason, double out_mm) {
  switch (reason) {
    case MouthCornerReason::kNotchEnds:
      return absl::StrFormat(
          "The %s corner of the mouth, %.0f mm from the midline, was found by the depth of the "
          "notch between the lips.",
          side, out_mm);
    case MouthCornerReason::kNoNotch:
      return absl::StrFormat(
          "The %s corner of the mouth is unsure: the skin shows no clear end of the notch between "
          "the lips, so the corner was put %.0f mm from the midline, as in most adults.",
          side, out_mm);
    case MouthCornerReason::kCapped:
      return absl::StrFormat(
          "The %s corner of the mouth is unsure: the notch between the lips does not end, so the "
          "corner was put %.0f mm from the midline.",
          side, out_mm);
    case MouthCornerReason::kSkinNotSeen:
      break;
  }
  return absl::StrFormat(
      "The %s corner of the mouth is unsure: the CT does not show the skin more than %.0f mm from "
      "the midline.",
      side, out_mm);
}

std::string DescribeStart(MouthStart start) {
  return start == MouthStart::kUpperIncisors
             ? "3 mm over the edge of the upper incisors"
             : "midway between the jaws, as the upper front teeth are missing";
}

}  // namespace

bool MouthLine::line_is_sure() const { return given || seen_share >= kSureShare; }

absl::StatusOr<MouthLine> MouthLineThrough(const std::vector<Eigen::Vector3d>& places_mm,
                                           const Landmarks& landmarks) {
  const FaceAxes axes(landmarks);
  MouthLine line;
  line.given = true;
  for (const Eigen::Vector3d& place : places_mm) {
    const FaceCoordinates at = axes.Of(place);
    const bool is_left =
        line.points.empty() || at.left >= line.points.back().at.left + kGivenStepMm;
    if (!is_left || !(std::abs(at.left) <= kGivenHalfWidthMm)) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "point %d of the mouth line lies %.1f mm left of the midline; give points from the right "
          "corner to the left one, %g mm or more apart and within %g mm of the midline",
          line.points.size(), at.left, kGivenStepMm, kGivenHalfWidthMm));
    }
    const double over_incisors_mm = at.up - axes.Of(landmarks.upper_incisor).up;
    if (!(std::abs(over_incisors_mm) <= kGivenHeightMm)) {
      return absl::InvalidArgumentError(
          absl::StrFormat("point %d of the mouth line lies %.1f mm over the edge of the upper "
                          "incisors; give points "
                          "between the lips, within %g mm of it (LPS, mm)",
                          line.points.size(), over_incisors_mm, kGivenHeightMm));
    }
    line.points.push_back({.at = at});
  }
  if (line.points.size() < 3) {
    return absl::InvalidArgumentError("a mouth line has three points or more");
  }
  return line;
}

absl::StatusOr<MouthLine> FindMouthLine(const FaceRelief& measured, double start_up) {
  const FaceRelief relief = SmoothAlongLeft(measured);
  std::vector<LipColumn> columns;
  for (Index column = 0; column < relief.front_mm.cols(); ++column) {
    if (std::abs(relief.LeftOf(column)) > kMouthHalfWidthCapMm + 1e-6) continue;
    columns.emplace_back(relief, column, start_up);
  }
  if (columns.empty()) return absl::InvalidArgumentError("the skin of the mouth is not in view");
  const Index low = columns[0].RowAt(start_up - kFallenJawMm);
  const Index num_rows = columns[0].RowAt(start_up + kMouthLineSearchMm) - low + 1;
  const std::vector<Index> rows = PathSearch(columns, low, num_rows, relief.row_mm).Run();
  MouthLine line;
  line.start_up = start_up;
  std::vector<Seen> seen;
  for (size_t i = 0; i < columns.size(); ++i) {
    seen.push_back(columns[i].At(rows[i]).seen);
    line.points.push_back(columns[i].PointAt(rows[i], measured));
  }
  if (seen[columns.size() / 2] == Seen::kNothing) {
    return absl::InvalidArgumentError("the skin of the mouth is not in view");
  }
  KeepBetweenCorners(seen, &line);
  return line;
}

absl::StatusOr<MouthLine> FindMouthLine(const HeadSegmentation& head, const Landmarks& landmarks) {
  const FaceAxes axes(landmarks);
  const double upper = axes.Of(landmarks.upper_incisor).up;
  const double lower = axes.Of(landmarks.lower_incisor).up;
  const bool has_teeth = ShowsTooth(head, landmarks.upper_incisor);
  const double start_up = has_teeth ? upper + kOverIncisorMm : (upper + lower) / 2;
  const FaceRelief relief =
      MeasureFaceRelief(head, axes,
                        {.half_width_mm = kReliefHalfWidthMm,
                         .bottom_mm = start_up - kFallenJawMm - kLipHeightMm,
                         .top_mm = start_up + kBelowNoseMm + kLipHeightMm,
                         .foremost_mm = axes.Of(landmarks.upper_incisor).front + kReliefFrontMm,
                         .depth_mm = kReliefDepthMm});
  TF_ASSIGN_OR_RETURN(MouthLine line, FindMouthLine(relief, start_up));
  line.start = has_teeth ? MouthStart::kUpperIncisors : MouthStart::kJawRidges;
  line.near_metal = IsNearMetal(head, axes, line);
  return line;
}

std::vector<std::string> DescribeMouthLine(const MouthLine& line) {
  if (line.given) return {"The mouth line was given by the recipe."};
  const double width_mm = line.points.back().at.left - line.points.front().at.left;
  std::string found = absl::StrFormat(
      "The mouth line %s: lips or a notch of %g mm or more between them are seen along %.0f %% of "
      "%.0f mm, within %.0f mm of a height %s.",
      line.line_is_sure() ? "was found" : "is unsure", kShallowNotchMm, 100 * line.seen_share,
      width_mm, kMouthLineSearchMm, DescribeStart(line.start));
  if (line.parted_share > 0) {
    absl::StrAppendFormat(&found, " The lips are apart along %.0f %% of it.",
                          100 * line.parted_share);
  }
  if (line.near_metal) absl::StrAppend(&found, " Metal is near and may blur the skin in the CT.");
  return {std::move(found),
          DescribeCorner("right", line.right_corner, -line.points.front().at.left),
          DescribeCorner("left", line.left_corner, line.points.back().at.left)};
}

}  // namespace tissueform
