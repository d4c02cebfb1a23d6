// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/series/series_facts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_format.h"
#include <Eigen/Core>

#include "core/imaging/series/image_header.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

// Two images nearer than this lie at one place.
constexpr double kSamePlaceMm = 0.01;
// Directions whose cosine is nearer to 1 are the same; what scanners write has 6 digits.
constexpr double kSameDirection = 1e-4;
// A gantry is tilted by up to 30 degrees.
const double kAxialCosine = std::cos(31.0 * M_PI / 180.0);
// A place is missing where the next image is farther than so many spacings.
constexpr double kGapSpacings = 1.5;

// Whether position and axes can be calculated with: a header may hold any number.
bool HasPlace(const ImageHeader& image) {
  return image.position_mm && image.position_mm->cwiseAbs().maxCoeff() <= kMaxPositionMm &&
         image.axes && image.axes->cwiseAbs().maxCoeff() < 2;
}

Vector3d UnitNormalOf(const ImageHeader& image) {
  const Vector3d normal = SliceNormal(image);
  const double length = normal.norm();
  return length > 0 ? Vector3d(normal / length) : Vector3d::UnitZ();
}

SliceOrientation PlaneOf(const Vector3d& normal) {
  if (std::abs(normal.z()) >= kAxialCosine) return SliceOrientation::kAxial;
  if (std::abs(normal.y()) >= kAxialCosine) return SliceOrientation::kCoronal;
  if (std::abs(normal.x()) >= kAxialCosine) return SliceOrientation::kSagittal;
  return SliceOrientation::kOblique;
}

// Sorted, of those that have a place; all along the first one's normal.
std::vector<double> PlacesOf(const std::vector<ImageHeader>& images, SeriesFacts* facts) {
  std::vector<Vector3d> normals;
  std::vector<double> places;
  for (const ImageHeader& image : images) {
    if (!HasPlace(image)) continue;
    const Vector3d normal = UnitNormalOf(image);
    const auto same = [&normal](const Vector3d& known) {
      return known.dot(normal) > 1 - kSameDirection;
    };
    if (std::none_of(normals.begin(), normals.end(), same)) normals.push_back(normal);
    places.push_back(normals.front().dot(*image.position_mm));
  }
  std::sort(places.begin(), places.end());
  facts->orientations = static_cast<int>(normals.size());
  if (!normals.empty()) facts->plane = PlaneOf(normals.front());
  return places;
}

void MeasurePlaces(const std::vector<double>& places, SeriesFacts* facts) {
  std::vector<double> steps;
  for (size_t i = 1; i < places.size(); ++i) {
    const double step = places[i] - places[i - 1];
    if (step <= kSamePlaceMm) {
      ++facts->duplicates;
    } else {
      steps.push_back(step);
    }
  }
  facts->slices = static_cast<int>(places.size()) - facts->duplicates;
  if (steps.empty()) return;
  std::vector<double> sorted = steps;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<long>(sorted.size() / 2),
                   sorted.end());
  facts->spacing_mm = sorted[sorted.size() / 2];
  facts->coverage_mm = places.back() - places.front() + facts->spacing_mm;
  for (const double step : steps) {
    if (step > kGapSpacings * facts->spacing_mm) {
      // A place far off is one gap, not a million.
      facts->missing +=
          static_cast<int>(std::min(std::round(step / facts->spacing_mm) - 1, 100'000.0));
    }
  }
}

// SOP class, and whether it is a scout.
using ObjectKind = std::pair<std::string, bool>;

ObjectKind KindOf(const ImageHeader& image) { return {image.class_uid, IsLocaliser(image)}; }

ObjectKind KindOfSlices(const std::vector<ImageHeader>& objects) {
  const ObjectKind ct_slice = {std::string(kCtImageClass), false};
  std::map<ObjectKind, int> counts;
  for (const ImageHeader& object : objects) ++counts[KindOf(object)];
  if (counts.contains(ct_slice)) return ct_slice;
  return std::max_element(counts.begin(), counts.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

bool StatesHounsfield(const ImageHeader& image) {
  return image.rescale_slope.has_value() && image.rescale_intercept.has_value() &&
         (image.rescale_type.empty() || image.rescale_type == "HU");
}

const char* PlaneName(SliceOrientation plane) {
  constexpr std::array<const char*, 5> kNames = {"axial", "coronal", "sagittal", "oblique",
                                                 "placeless"};
  return kNames[static_cast<size_t>(plane)];
}

}  // namespace

SeriesFacts FactsOfSeries(const std::string& key, const std::vector<ImageHeader>& objects) {
  const ObjectKind kind = KindOfSlices(objects);
  std::vector<ImageHeader> images;
  std::copy_if(objects.begin(), objects.end(), std::back_inserter(images),
               [&kind](const ImageHeader& object) { return KindOf(object) == kind; });
  const ImageHeader& first = images.front();
  SeriesFacts facts = {.key = key,
                       .study_uid = first.study_uid,
                       .modality = first.modality,
                       .description = first.series_description,
                       .number = first.series_number.value_or(0),
                       .images = static_cast<int>(images.size()),
                       .set_aside = static_cast<int>(objects.size() - images.size()),
                       .thickness_mm = first.slice_thickness_mm.value_or(0),
                       .kernel = KernelKindOf(first.convolution_kernel),
                       .localiser = kind.second,
                       .multi_frame = IsCtClass(kind.first) && kind.first != kCtImageClass};
  std::set<std::string> frames;
  for (const ImageHeader& image : images) {
    frames.insert(image.frame_uid);
    facts.contrast = facts.contrast || !image.contrast.empty();
    facts.derived = facts.derived || absl::StartsWith(image.image_type, "DERIVED");
    facts.without_hounsfield += StatesHounsfield(image) ? 0 : 1;
  }
  facts.frames_of_reference = static_cast<int>(frames.size());
  MeasurePlaces(PlacesOf(images, &facts), &facts);
  return facts;
}

std::string DescribeFacts(const SeriesFacts& facts) {
  constexpr std::array<const char*, 3> kKernels = {"soft kernel", "sharp kernel",
                                                   "kernel of unknown kind"};
  const std::string aside = facts.set_aside > 0
                                ? absl::StrFormat("; ignored: %d other object%s", facts.set_aside,
                                                  facts.set_aside > 1 ? "s" : "")
                                : "";
  if (facts.multi_frame) {
    return absl::StrFormat("%d multi-frame images (Enhanced CT)%s", facts.images, aside);
  }
  return absl::StrFormat("%d %s slices, %.2f mm apart, over %.0f mm, %s%s%s", facts.slices,
                         PlaneName(facts.plane), facts.spacing_mm, facts.coverage_mm,
                         kKernels[static_cast<size_t>(facts.kernel)],
                         facts.contrast ? ", contrast medium" : "", aside);
}

}  // namespace tissueform
