// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/bridge_queue.h"
#include "client/pacs_bridge/work/series_intake.h"

namespace tissueform {

// What the queue holds, by keys, states and numbers: nothing of a patient. As a table, or as one
// JSON object. Errors: those of the queue.
absl::StatusOr<std::string> StatusTable(BridgeQueue* queue);
absl::StatusOr<std::string> StatusJson(BridgeQueue* queue);

// Every series of the queue with what it is and why it was chosen or not, study by study: for a
// person, who sees the study's date and UID but no patient.
absl::StatusOr<std::string> SeriesTable(BridgeQueue* queue, SeriesIntake* intake);

}  // namespace tissueform
