// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/base/types.h"
#include "core/mesh/generation/surface_distance.h"
#include "core/mesh/rigid_move.h"
#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// Points of a surface and where it faces there, #P by 3 each.
struct OrientedPoints {
  Positions points;
  Positions normals;  // unit vectors
};

// Centroids of at most `count` triangles, spread evenly over their numbers. Triangles without area
// are left out.
OrientedPoints SampleTriangles(const TriangleMesh& mesh, Eigen::Index count);

struct RegistrationOptions {
  // At most this share of the points is used, the nearest ones: the others have moved, or are not
  // on the target.
  double keep = 1;
  // Points whose nearest point of the target faces otherwise are not used.
  bool compare_normals = true;
  // The target may stand out from the true surface by one distance everywhere, as bone does that
  // was scanned with another kernel or cut at another threshold; the distance is found as well.
  // Pulled a little towards 0, where the points do not tell it from a translation.
  bool target_stands_out = false;
  int max_rounds = 120;
};

struct Registration {
  RigidMove move;
  double rms_mm = 0;         // of the points that were used, from the target
  double all_rms_mm = 0;     // of all points
  double share = 0;          // of the points that were used, in [0, 1]
  double stands_out_mm = 0;  // RegistrationOptions::target_stands_out; distances are without it
  // Mean distance of all points, each counted with at most 10 mm, and with 10 mm where it faces
  // otherwise: what distinguishes a wrong start from a right one.
  double score_mm = 0;
};

// Takes points of one surface onto another by iterated closest points: from point to point first,
// then from point to plane, at last with weights that fall with the distance (Tukey), so that what
// has moved otherwise does not pull. Without compared normals all points count alike.
//
// One thread. Finds the place that is near the start: within about 20 degrees and 20 mm for a head.
class SurfaceRegistration {
 public:
  // REQUIRES: finite positions, at least one triangle with an area.
  explicit SurfaceRegistration(const TriangleMesh& target);

  // REQUIRES: at least three points.
  Registration Refine(const OrientedPoints& points, const RigidMove& start,
                      const RegistrationOptions& options) const;

 private:
  const NearestPoints nearest_;
};

}  // namespace tissueform
