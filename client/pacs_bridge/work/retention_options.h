// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>

namespace tissueform {

// How long what shows a patient stays in the bridge's folder.
struct RetentionOptions {
  // Received images and the plan that was built of them, after the series is done: published,
  // passed over, failed, stopped midway, or complete where nothing is chosen. Files that belong to
  // no series, after they came.
  std::chrono::hours keep_images{24 * 7};
  // The header without pixels that stands for the PACS where that cannot be asked for one; and what
  // is known of a series of which no case was made, and of its patient.
  std::chrono::hours keep_headers{24 * 90};
  // An unconfirmed export, with its pictures; after that it has failed.
  std::chrono::hours keep_asked{24 * 14};
  // What is known of an export, after its result was reported to the server.
  std::chrono::hours keep_exports{24 * 30};
};

// Whether something that began, or ended, at `since_s` (unix seconds; 0: not yet) is older.
inline bool IsOver(int64_t since_s, std::chrono::hours kept, int64_t now_s) {
  return since_s > 0 && now_s - since_s > std::chrono::seconds(kept).count();
}

}  // namespace tissueform
