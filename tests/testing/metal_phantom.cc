// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/metal_phantom.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <Eigen/Geometry>

#include "core/base/parallel_for.h"
#include "core/base/status_macros.h"
#include "core/imaging/ct/ct_volume_reader.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {
namespace {

// A slice's thickness in layers, and how fine metal is sampled: a wire of 0.5 mm is five points
// wide. Points are gathered into cells, which are still smaller than a channel.
constexpr int kLayers = 3;
constexpr int kDepthsOfLayer = 2;
constexpr double kPointMm = 0.1;
constexpr double kCellMm = 0.2;

constexpr int kFiner = 4;

constexpr uint32_t kOtherNoise = 1000;  // more than there are slices, whose numbers are the seeds

// A place on the front of a tooth of the bundled head, where its bone falls under 1000 HU, and the
// direction out of the mouth there. Brackets push lips out; those of the bundled head lie on bare
// teeth. So where little of the lip lies over a front (four incisors), it is set deeper or higher,
// and over every bracket 3 mm of lip or more are left.
struct ToothFront {
  Eigen::Vector3d place_mm;
  Eigen::Vector3d out;
};

// From the left first molar to the right one.
const std::array<ToothFront, 12> kUpperFronts = {{{{-66.7, 65.9, -82.0}, {0.96, -0.29, 0}},
                                                  {{-70.1, 58.0, -85.0}, {0.95, -0.32, 0}},
                                                  {{-72.4, 51.4, -87.5}, {0.93, -0.36, 0}},
                                                  {{-75.3, 43.9, -89.5}, {0.75, -0.66, 0}},
                                                  {{-84.3, 42.0, -91.0}, {0.42, -0.91, 0}},
                                                  {{-91.2, 40.2, -89.0}, {0.17, -0.99, 0}},
                                                  {{-100.1, 39.2, -89.0}, {-0.08, -1.00, 0}},
                                                  {{-107.5, 42.1, -91.0}, {-0.39, -0.92, 0}},
                                                  {{-116.4, 44.4, -90.0}, {-0.79, -0.62, 0}},
                                                  {{-119.6, 51.2, -88.5}, {-0.92, -0.39, 0}},
                                                  {{-122.7, 57.3, -87.0}, {-0.95, -0.31, 0}},
                                                  {{-125.5, 67.0, -83.0}, {-0.99, -0.17, 0}}}};
const std::array<ToothFront, 12> kLowerFronts = {{{{-71.8, 69.3, -95.0}, {0.80, -0.60, 0}},
                                                  {{-75.9, 63.2, -99.5}, {0.88, -0.47, 0}},
                                                  {{-77.9, 58.2, -101.5}, {0.92, -0.38, 0}},
                                                  {{-81.5, 51.6, -105.0}, {0.66, -0.75, 0}},
                                                  {{-89.9, 49.7, -105.5}, {0.34, -0.94, 0}},
                                                  {{-95.8, 47.8, -106.0}, {0.09, -1.00, 0}},
                                                  {{-101.5, 48.9, -106.0}, {-0.28, -0.96, 0}},
                                                  {{-105.8, 52.5, -106.0}, {-0.58, -0.82, 0}},
                                                  {{-111.5, 53.8, -105.5}, {-0.77, -0.64, 0}},
                                                  {{-113.8, 58.0, -103.0}, {-0.87, -0.49, 0}},
                                                  {{-117.3, 63.4, -100.0}, {-0.87, -0.48, 0}},
                                                  {{-121.0, 68.6, -96.5}, {-0.87, -0.50, 0}}}};
constexpr size_t kFirstBracket = 2;
constexpr size_t kLastBracket = 9;
constexpr double kBracketWide = 3;
constexpr double kBracketHigh = 3;
constexpr double kBracketDeep = 2;
constexpr double kWireMm = 0.5;

MetalPart Ellipsoid(const Eigen::Vector3d& centre_mm, const Eigen::Vector3d& half_mm) {
  return {.shape = MetalShape::kEllipsoid, .centre_mm = centre_mm, .half_mm = half_mm};
}

// Its inner side on the tooth.
MetalPart Bracket(const ToothFront& tooth) {
  MetalPart part;
  const Eigen::Vector3d out = tooth.out.normalized();
  part.centre_mm = tooth.place_mm + 0.5 * kBracketDeep * out;
  part.axes.col(0) = out;
  part.axes.col(1) = Eigen::Vector3d::UnitZ();
  part.axes.col(2) = out.cross(Eigen::Vector3d::UnitZ());
  part.half_mm = 0.5 * Eigen::Vector3d(kBracketDeep, kBracketHigh, kBracketWide);
  return part;
}

MetalPart Rod(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius_mm) {
  MetalPart part;
  part.shape = MetalShape::kRod;
  part.centre_mm = 0.5 * (from + to);
  part.axes =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), to - from).toRotationMatrix();
  part.half_mm = {0.5 * (to - from).norm(), radius_mm, radius_mm};
  return part;
}

void AddBraces(const std::array<ToothFront, 12>& fronts, std::vector<MetalPart>* parts) {
  const auto slot = [&fronts](size_t i) {
    return Eigen::Vector3d(fronts[i].place_mm + 0.5 * kBracketDeep * fronts[i].out);
  };
  for (size_t i = 0; i < fronts.size(); ++i) {
    if (i >= kFirstBracket && i <= kLastBracket) parts->push_back(Bracket(fronts[i]));
    if (i > 0) parts->push_back(Rod(slot(i - 1), slot(i), 0.5 * kWireMm));
  }
}

// Weights of Catmull and Rom's cubic for the four neighbours of a place at `t` of its cell.
Eigen::Vector4d CubicWeights(double t) {
  return 0.5 * Eigen::Vector4d(-t + 2 * t * t - t * t * t, 2 - 5 * t * t + 3 * t * t * t,
                               t + 4 * t * t - 3 * t * t * t, -t * t + t * t * t);
}

// What a finer row takes from the coarse one.
struct CubicTap {
  std::array<int, 4> from;
  Eigen::Vector4d weights;
};

std::vector<CubicTap> CubicTaps(int coarse) {
  std::vector<CubicTap> taps;
  for (int i = 0; i < coarse * kFiner; ++i) {
    const double place = (i + 0.5) / kFiner - 0.5;
    const int lower = static_cast<int>(std::floor(place));
    CubicTap tap{.from = {}, .weights = CubicWeights(place - lower)};
    for (int n = 0; n < 4; ++n) {
      tap.from[static_cast<size_t>(n)] = std::clamp(lower - 1 + n, 0, coarse - 1);
    }
    taps.push_back(tap);
  }
  return taps;
}

// A slice has one row of coarse values a coarse row: along x first, then along y.
void RefineSlice(const int16_t* coarse, const std::vector<CubicTap>& across,
                 const std::vector<CubicTap>& down, int16_t* fine) {
  const auto width = static_cast<Eigen::Index>(across.size());
  const auto height = static_cast<Eigen::Index>(down.size());
  const Eigen::Index coarse_width = width / kFiner;
  Eigen::MatrixXd rows(width, height / kFiner);
  for (Eigen::Index y = 0; y < rows.cols(); ++y) {
    for (Eigen::Index x = 0; x < width; ++x) {
      const CubicTap& tap = across[static_cast<size_t>(x)];
      double sum = 0;
      for (size_t n = 0; n < 4; ++n) {
        sum += tap.weights[static_cast<Eigen::Index>(n)] * coarse[y * coarse_width + tap.from[n]];
      }
      rows(x, y) = sum;
    }
  }
  for (Eigen::Index y = 0; y < height; ++y) {
    const CubicTap& tap = down[static_cast<size_t>(y)];
    Eigen::VectorXd row = Eigen::VectorXd::Zero(width);
    for (size_t n = 0; n < 4; ++n) {
      row += tap.weights[static_cast<Eigen::Index>(n)] * rows.col(tap.from[n]);
    }
    for (Eigen::Index x = 0; x < width; ++x) {
      fine[y * width + x] = static_cast<int16_t>(std::lround(std::clamp(row[x], -1024.0, 3071.0)));
    }
  }
}

// The points of a layer that a part holds, gathered into cells of the slice's plane.
class CellGatherer {
 public:
  CellGatherer(const CtVolume& volume, int slice)
      : middle_mm_(volume.origin_mm + volume.StepsMm() * Eigen::Vector3d(0.5 * (volume.size[0] - 1),
                                                                         0.5 * (volume.size[1] - 1),
                                                                         slice)),
        direction_(volume.direction),
        half_(static_cast<int>(0.5 * volume.size[0] * volume.spacing_mm.x() / kCellMm)) {}

  std::vector<MetalCell> Gather(const MetalWork& work, double from_mm, double to_mm) const {
    std::vector<int> points(static_cast<size_t>(4 * half_ * half_), 0);
    for (int depth = 0; depth < kDepthsOfLayer; ++depth) {
      const double z_mm = from_mm + (to_mm - from_mm) * (depth + 0.5) / kDepthsOfLayer;
      AddPoints(work, z_mm, &points);
    }
    return CellsOf(points);
  }

 private:
  // Each point once, though parts overlap where a wire runs through a bracket.
  void AddPoints(const MetalWork& work, double z_mm, std::vector<int>* points) const {
    std::vector<std::pair<int, int>> inside;
    for (const MetalPart& part : work.parts) {
      const Eigen::Vector3d centre = direction_.transpose() * (part.centre_mm - middle_mm_);
      const double reach = part.half_mm.norm();
      if (std::abs(centre.z() - z_mm) > reach) continue;
      const auto point = [](double mm) { return static_cast<int>(std::floor(mm / kPointMm)); };
      for (int y = point(centre.y() - reach); y <= point(centre.y() + reach); ++y) {
        for (int x = point(centre.x() - reach); x <= point(centre.x() + reach); ++x) {
          const Eigen::Vector3d place((x + 0.5) * kPointMm, (y + 0.5) * kPointMm, z_mm);
          if (part.Contains(middle_mm_ + direction_ * place)) inside.emplace_back(y, x);
        }
      }
    }
    std::sort(inside.begin(), inside.end());
    inside.erase(std::unique(inside.begin(), inside.end()), inside.end());
    for (const auto& [y, x] : inside) ++(*points)[CellOf(x, y)];
  }

  size_t CellOf(int x, int y) const {
    const auto cell = [this](int point) {
      const auto at = static_cast<int>(std::floor((point + 0.5) * kPointMm / kCellMm)) + half_;
      return std::clamp(at, 0, 2 * half_ - 1);
    };
    return static_cast<size_t>(cell(y) * 2 * half_ + cell(x));
  }

  std::vector<MetalCell> CellsOf(const std::vector<int>& points) const {
    std::vector<MetalCell> cells;
    const double area = kPointMm * kPointMm / kDepthsOfLayer;
    for (int i = 0; i < 4 * half_ * half_; ++i) {
      if (points[static_cast<size_t>(i)] == 0) continue;
      const auto mm = [this](int cell) {
        return static_cast<float>((cell - half_ + 0.5) * kCellMm);
      };
      cells.push_back({.x_mm = mm(i % (2 * half_)),
                       .y_mm = mm(i / (2 * half_)),
                       .area_mm2 = static_cast<float>(area * points[static_cast<size_t>(i)])});
    }
    return cells;
  }

  Eigen::Vector3d middle_mm_;
  Eigen::Matrix3d direction_;
  int half_;
};

bool HasMetal(const MetalLayers& layers) {
  return std::any_of(layers.begin(), layers.end(),
                     [](const auto& cells) { return !cells.empty(); });
}

// One slice of a volume as a scanner sees it, with metal or without.
class ScannedSlice {
 public:
  ScannedSlice(const CtScanner& scanner, const CtVolume& volume, int k)
      : scanner_(scanner),
        size_(volume.size[0]),
        pixel_mm_(volume.spacing_mm.x()),
        first_(static_cast<size_t>(k) * static_cast<size_t>(size_ * size_)),
        seed_(static_cast<uint32_t>(k)),
        tissue_(TissueOfHu(&volume.hu[first_], size_, pixel_mm_)),
        lengths_(scanner.ProjectTissue(tissue_)),
        free_(scanner.Transmission(lengths_)) {}

  // `layers` of metal may be empty.
  void Write(const MetalWork& work, const MetalLayers& layers, CtVolume* volume,
             uint32_t other_noise = 0) const {
    const Eigen::ArrayXXf seen =
        layers.empty() ? free_ : scanner_.WithMetal(free_, tissue_, lengths_, work.metal, layers);
    const std::vector<int16_t> hu =
        scanner_.Reconstruct(scanner_.Measure(seen, seed_ + other_noise), size_, pixel_mm_);
    std::copy(hu.begin(), hu.end(), volume->hu.begin() + static_cast<std::ptrdiff_t>(first_));
  }

 private:
  const CtScanner& scanner_;
  int size_;
  double pixel_mm_;
  size_t first_;
  uint32_t seed_;
  TissueSlice tissue_;
  TissueLengths lengths_;
  Eigen::ArrayXXf free_;
};

// One slice of all heads. Without metal in it, a head's slice is that of the free one.
void ScanSlice(const CtScanner& scanner, const CtVolume& fine, int k, SimulatedHeads* heads) {
  const ScannedSlice slice(scanner, fine, k);
  slice.Write({}, {}, &heads->free);
  slice.Write({}, {}, &heads->again, kOtherNoise);
  for (const auto& [work, head] :
       {std::pair(Fillings(), &heads->fillings), std::pair(Braces(), &heads->braces)}) {
    slice.Write(work, LayersOf(work, fine, k), head);
  }
}

}  // namespace

bool MetalPart::Contains(const Eigen::Vector3d& point_mm) const {
  const Eigen::Vector3d own = axes.transpose() * (point_mm - centre_mm);
  switch (shape) {
    case MetalShape::kBox:
      return (own.cwiseAbs().array() <= half_mm.array()).all();
    case MetalShape::kEllipsoid:
      return own.cwiseQuotient(half_mm).squaredNorm() <= 1;
    case MetalShape::kRod:
      const double beyond = std::max(0.0, std::abs(own.x()) - half_mm.x());
      return std::hypot(beyond, own.y(), own.z()) <= half_mm.y();
  }
  return false;
}

MetalWork Fillings() {
  return {.metal = Metal::kAmalgam,
          .parts = {Ellipsoid({-72.4, 67.6, -82.5}, {2.2, 2.6, 1.8}),     // upper left first molar
                    Ellipsoid({-74.8, 59.6, -85.5}, {1.8, 1.6, 1.6}),     // and second premolar
                    Ellipsoid({-119.8, 68.5, -84.0}, {2.3, 2.6, 1.8}),    // upper right first molar
                    Ellipsoid({-74.6, 72.0, -93.8}, {2.3, 2.5, 1.8}),     // lower left first molar
                    Ellipsoid({-72.4, 81.2, -87.8}, {2.2, 2.4, 1.7}),     // and second molar
                    Ellipsoid({-117.2, 70.8, -95.2}, {2.3, 2.5, 1.8}),    // lower right first molar
                    Ellipsoid({-114.0, 65.2, -98.2}, {1.8, 1.6, 1.6})}};  // and second premolar
}

MetalWork Braces() {
  MetalWork work;
  AddBraces(kUpperFronts, &work.parts);
  AddBraces(kLowerFronts, &work.parts);
  return work;
}

absl::StatusOr<CtVolume> FineHead() {
  CtReadOptions options;
  options.hu_offset = -1024;
  options.axes = "RPI";
  TF_ASSIGN_OR_RETURN(const CtVolume coarse,
                      ReadCtVolume(TestDataPath("ct/headsq/headsq_quarter.nhdr"), options));
  CtVolume fine = coarse;
  const Eigen::Vector3d shift = Eigen::Vector3d(0.5, 0.5, 0) * (1.0 / kFiner - 1);
  fine.origin_mm = coarse.origin_mm + coarse.StepsMm() * shift;
  fine.size = {coarse.size[0] * kFiner, coarse.size[1] * kFiner, coarse.size[2]};
  fine.spacing_mm.head<2>() /= kFiner;
  fine.hu.resize(static_cast<size_t>(fine.num_voxels()));
  const std::vector<CubicTap> across = CubicTaps(coarse.size[0]);
  const std::vector<CubicTap> down = CubicTaps(coarse.size[1]);
  for (int k = 0; k < coarse.size[2]; ++k) {
    RefineSlice(&coarse.hu[static_cast<size_t>(k * coarse.size[0] * coarse.size[1])], across, down,
                &fine.hu[static_cast<size_t>(k * fine.size[0] * fine.size[1])]);
  }
  return fine;
}

MetalLayers LayersOf(const MetalWork& work, const CtVolume& volume, int slice) {
  const CellGatherer gatherer(volume, slice);
  const double layer_mm = volume.spacing_mm.z() / kLayers;
  MetalLayers layers;
  for (int layer = 0; layer < kLayers; ++layer) {
    const double from_mm = (layer - 0.5 * kLayers) * layer_mm;
    layers.push_back(gatherer.Gather(work, from_mm, from_mm + layer_mm));
  }
  return HasMetal(layers) ? layers : MetalLayers{};
}

absl::StatusOr<SimulatedHeads> SimulateHeads(int threads, const std::vector<int>& only) {
  TF_ASSIGN_OR_RETURN(const CtVolume fine, FineHead());
  SimulatedHeads heads{.free = fine, .again = fine, .fillings = fine, .braces = fine, .slices = {}};
  const MetalWork fillings = Fillings();
  const MetalWork braces = Braces();
  for (int k = 0; k < fine.size[2]; ++k) {
    if (!only.empty() && std::find(only.begin(), only.end(), k) == only.end()) continue;
    if (!LayersOf(fillings, fine, k).empty() || !LayersOf(braces, fine, k).empty()) {
      heads.slices.push_back(k);
    }
  }
  const CtScanner scanner;
  ParallelFor(threads, static_cast<Eigen::Index>(heads.slices.size()), 1,
              [&](Eigen::Index begin, Eigen::Index end) {
                for (Eigen::Index i = begin; i < end; ++i) {
                  ScanSlice(scanner, fine, heads.slices[static_cast<size_t>(i)], &heads);
                }
              });
  return heads;
}

void ScanWithMetal(const MetalWork& work, int threads, CtVolume* volume) {
  const CtScanner scanner;
  ParallelFor(threads, volume->size[2], 1, [&](Eigen::Index begin, Eigen::Index end) {
    for (Eigen::Index k = begin; k < end; ++k) {
      const MetalLayers layers = LayersOf(work, *volume, static_cast<int>(k));
      if (layers.empty()) continue;
      ScannedSlice(scanner, *volume, static_cast<int>(k)).Write(work, layers, volume);
    }
  });
}

}  // namespace tissueform::testing
