// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume.h"
#include "tests/testing/ct_scanner.h"

// The bundled head as a CT with fillings or braces would show it, and without, so that only the
// metal differs.
namespace tissueform::testing {

enum class MetalShape { kBox, kEllipsoid, kRod };

struct MetalPart {
  MetalShape shape = MetalShape::kBox;
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();       // LPS
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();        // columns: the part's own axes
  Eigen::Vector3d half_mm = Eigen::Vector3d::Constant(0.5);  // a rod: half its length, its radius

  bool Contains(const Eigen::Vector3d& point_mm) const;
};

struct MetalWork {
  Metal metal = Metal::kSteel;
  std::vector<MetalPart> parts;
};

// Seven amalgam fillings, 3 to 5 mm wide, in molars and premolars of both jaws of the bundled head.
MetalWork Fillings();

// Steel brackets, 3 x 3 x 2 mm, on the front of eight teeth of either jaw, with arch wires of 0.5
// mm that run on to the first molars.
MetalWork Braces();

// The bundled head with pixels of 0.8 instead of 3.2 mm, cubic in the slices; slices stay.
absl::StatusOr<CtVolume> FineHead();

// The metal of one slice of a volume whose slices lie square to z.
MetalLayers LayersOf(const MetalWork& work, const CtVolume& volume, int slice);

struct SimulatedHeads {
  CtVolume free;
  CtVolume again;  // free of metal as well, with other noise: how much a plan differs by that alone
  CtVolume fillings;
  CtVolume braces;
  std::vector<int> slices;  // that were scanned: the metal's, of either kind
};

// All with the same scanner, and but for `again` with the same noise; of `only`, where it is not
// empty, the slices with metal. About 10 s on one core; the result does not depend on the threads.
absl::StatusOr<SimulatedHeads> SimulateHeads(int threads, const std::vector<int>& only = {});

// Puts metal into a volume with square slices: those that hold some are scanned, the others stay.
// Does not depend on `threads`.
void ScanWithMetal(const MetalWork& work, int threads, CtVolume* volume);

}  // namespace tissueform::testing
