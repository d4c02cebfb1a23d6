// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "core/base/cancellation.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/uncertainty/material_uncertainty.h"

namespace tissueform {

// The band of uncertainty of chosen vertices for any pose, as prepared answers give positions: by
// linear elasticity and in first order (ExpandLinearElastic, FirstOrderBand), whose sensitivities
// are 12 columns a handle for every variable, as the answer itself is. Single precision.
//
// Constant: any number of threads may ask at once.
class BandColumns {
 public:
  // `vertices` are numbers of the mesh's. `admission`, which may be empty, is asked for the memory
  // of the columns and the additional memory that computing them takes.
  //
  // Errors: those of ExpandLinearElastic, or what the admission says.
  static absl::StatusOr<std::unique_ptr<BandColumns>> Create(
      std::shared_ptr<MeshPreparation> preparation, const MaterialUncertainty& uncertainty,
      const std::vector<int32_t>& vertices, const FactorAdmission& admission,
      const Cancellation& cancellation = {});

  // Of each vertex the 95th percentile of the distance in mm, resized; empty where a handle turns
  // too far for a band (HasBand of core/mechanics/answer_evaluator), in answers that are prepared
  // for turns up to `max_rotation_rad`. REQUIRES: one legal pose per handle.
  void Evaluate(absl::Span<const HandlePose> poses, double max_rotation_rad,
                Eigen::VectorXf* band_mm) const;

  // Adds the band to answers at the same vertices by an elastic model on the same preparation, in
  // columns as few as keep its fields within kBandTolerance of the mesh's diagonal for the widest
  // poses, all that is cut added up as if it did its worst at once. For moves of operations (up to
  // 10 mm and 8 degrees about a segment's middle) a head's band is then off by less than 0.07 mm,
  // where a band is read in steps of 0.1: proven by FirstOrderBand's slope and what is left of the
  // columns (band_bound_test.cc). Of 1,000 random ones the worst is off by 0.02; see
  // docs/prepared-answers.md.
  void Describe(PortableAnswers* answers) const;
  static constexpr double kBandTolerance = 2e-3;

  int64_t bytes_held() const;

 private:
  BandColumns(std::shared_ptr<MeshPreparation> preparation, const ElasticSystem& elastic)
      : preparation_(std::move(preparation)), elastic_(elastic) {}

  const std::shared_ptr<MeshPreparation> preparation_;  // owns elastic_
  const ElasticSystem& elastic_;
  std::vector<Eigen::MatrixXf> columns_;  // of each variable 3 #vertices by 12 #handles
};

}  // namespace tissueform
