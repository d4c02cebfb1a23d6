// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/mesh/generation/old_surface.h"
#include "core/mesh/generation/surface_remeshing.h"

namespace tissueform {

// The length that edges shall have at a place.
double WantedLength(const RemeshingOptions& options, const Eigen::Vector3d& place);

// Isotropic remeshing (Botsch and Kobbelt 2004) of a closed surface: rounds of splits of long
// edges, collapses of short ones, flips, and relaxation along the surface with projection onto the
// old one. Takes intersections neither out nor in account. The result does not depend on the
// number of threads.
TriangleMesh RemeshOnce(const TriangleMesh& surface, const OldSurface& old,
                        const RemeshingOptions& options);

}  // namespace tissueform
