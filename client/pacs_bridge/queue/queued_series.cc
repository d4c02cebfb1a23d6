// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/queue/queued_series.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "client/pacs_bridge/queue/bridge_queue.h"
#include "core/base/status_macros.h"
#include "core/imaging/series/image_header.h"

namespace tissueform {
namespace {

constexpr std::array<const char*, 11> kSeriesStates = {
    "receiving", "incomplete", "complete", "passed_over", "chosen", "built",
    "packed",    "published",  "failed",   "drafting",    "draft"};

absl::StatusOr<SeriesState> StateOf(absl::string_view name) {
  for (size_t i = 0; i < kSeriesStates.size(); ++i) {
    if (name == kSeriesStates[i]) return static_cast<SeriesState>(i);
  }
  return absl::DataLossError("the queue has a series in an unknown state");
}

}  // namespace

const char* SeriesStateName(SeriesState state) { return kSeriesStates[static_cast<size_t>(state)]; }

std::vector<QueuedImage> SourcesAmong(const std::vector<QueuedImage>& images) {
  std::vector<QueuedImage> sources;
  std::copy_if(images.begin(), images.end(), std::back_inserter(sources),
               [](const QueuedImage& image) { return IsCtClass(image.class_uid); });
  return sources.empty() ? images : sources;
}

absl::StatusOr<QueuedSeries> SeriesOf(const Database::Query& row) {
  QueuedSeries series;
  int column = 0;
  for (std::string* text :
       {&series.key, &series.study_uid, &series.uid, &series.frame_uid, &series.modality}) {
    *text = TextOf(row, column++);
  }
  TF_ASSIGN_OR_RETURN(series.state, StateOf(row.Text(column++)));
  for (std::string* text : {&series.reason, &series.recipe, &series.case_name}) {
    *text = TextOf(row, column++);
  }
  series.attempts = row.Integer(column++);
  series.last_error = TextOf(row, column++);
  series.first_s = row.Integer(column++);
  series.done_s = row.Integer(column++);
  series.has_files = row.Integer(column++) != 0;
  series.has_header = row.Integer(column++) != 0;
  series.images = row.Integer(column++);
  return series;
}

}  // namespace tissueform
