// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/skin_movement.h"

#include <algorithm>
#include <numeric>

#include "core/base/percentiles.h"

namespace tissueform {
namespace {

// Of a vertex that follows three of the mesh: it cannot stray farther than their mean does.
double BandOf(const FollowedVertices& follows, Eigen::Index vertex,
              const std::vector<double>& band_mm) {
  double band = 0;
  for (Eigen::Index c = 0; c < 3; ++c) {
    band += static_cast<double>(follows.weights(vertex, c)) *
            band_mm[static_cast<size_t>(follows.vertices(vertex, c))];
  }
  return band;
}

}  // namespace

std::vector<PlaceMovement> MovementOfPlaces(const PredictionObjectsInput& input,
                                            const PredictedCase& predicted) {
  std::vector<PlaceMovement> places;
  for (const CaseSkinRegion& region : input.contents.skin_regions) {
    std::vector<double> distances;
    std::optional<double> band;
    for (size_t s = 0; s < input.contents.surfaces.size(); ++s) {
      const CaseSurface& surface = input.contents.surfaces[s];
      for (size_t v = 0; v < surface.regions.size(); ++v) {
        if (surface.regions[v] != region.number) continue;
        const auto row = static_cast<Eigen::Index>(v);
        distances.push_back(
            (predicted.surfaces[s].row(row) - surface.positions.row(row)).cast<double>().norm());
        if (input.band_mm.empty() || !surface.follows) continue;
        band = std::max(band.value_or(0), BandOf(*surface.follows, row, input.band_mm));
      }
    }
    if (distances.empty()) continue;
    const double sum = std::accumulate(distances.begin(), distances.end(), 0.0);
    places.push_back({.name = region.name,
                      .mean_mm = sum / static_cast<double>(distances.size()),
                      .p95_mm = Percentile(distances, 95),
                      .largest_mm = Percentile(distances, 100),
                      .largest_band_mm = band});
  }
  return places;
}

HeadMovement InHeadFrame(const Eigen::Vector3d& movement, const HeadFrame& frame) {
  return {.left_mm = movement.dot(frame.left),
          .forward_mm = -movement.dot(frame.posterior),
          .up_mm = movement.dot(frame.superior)};
}

}  // namespace tissueform
