// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/cli/cases/packed_case.h"
#include "client/cli/export/moving_data.h"

namespace tissueform {

struct ExportedFaceOptions {
  std::string title = {};
  std::string model = {};                  // by its name in plans; empty: the plan's
  std::vector<std::string> segments = {};  // the handles with sliders; empty: all
};

// What a file shows of a plan: its surfaces, and prepared answers of the vertices that they follow,
// made here as a server makes them; of an elastic model with the band of uncertainty where the plan
// gives ranges of the material. Takes what preparing that model takes.
//
// Errors: InvalidArgument (an unknown model or segment; a model without prepared answers);
// FailedPrecondition (the plan's own poses lie beyond the model's prepared answers); those of
// MeshPreparation, CreateResponse and BandColumns.
absl::StatusOr<MovingData> ExportFace(OpenedPlan opened, const ExportedFaceOptions& options);

}  // namespace tissueform
