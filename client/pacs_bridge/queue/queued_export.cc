// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/queue/queued_export.h"

#include <array>

#include "client/pacs_bridge/queue/bridge_queue.h"

namespace tissueform {
namespace {

constexpr std::array<const char*, 7> kExportStates = {"asked", "confirmed", "fetched", "written",
                                                      "sent",  "told",      "failed"};

}  // namespace

const char* BridgeExportStateName(BridgeExportState state) {
  return kExportStates[static_cast<size_t>(state)];
}

absl::StatusOr<QueuedExport> ExportOf(const Database::Query& row) {
  QueuedExport found;
  int column = 0;
  for (std::string* text : {&found.name, &found.key, &found.prediction, &found.case_name}) {
    *text = TextOf(row, column++);
  }
  const absl::string_view state = row.Text(column++);
  size_t number = 0;
  while (number < kExportStates.size() && state != kExportStates[number]) ++number;
  if (number == kExportStates.size()) {
    return absl::DataLossError("the queue has an export in an unknown state");
  }
  found.state = static_cast<BridgeExportState>(number);
  found.note = TextOf(row, column++);
  found.confirmed = TextOf(row, column++);
  found.attempts = row.Integer(column++);
  found.last_error = TextOf(row, column++);
  found.first_s = row.Integer(column++);
  found.done_s = row.Integer(column++);
  return found;
}

}  // namespace tissueform
