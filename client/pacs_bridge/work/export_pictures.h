// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "absl/base/thread_annotations.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/queued_export.h"
#include "client/pacs_bridge/work/case_server.h"
#include "client/pacs_bridge/work/object_writer.h"
#include "core/base/mutex.h"

namespace tissueform {

// What an export shows before it is confirmed: pictures, and beside them the band of uncertainty,
// so that a restart writes the same. Any thread. What it is given must outlive it.
class ExportPictures {
 public:
  // `warn`: receives one line when an export is written without a band; may be empty.
  ExportPictures(CaseServer* server, ObjectWriter* writer,
                 std::function<void(const std::string& line)> warn)
      : server_(server), writer_(writer), warn_(std::move(warn)) {}

  // Whether pictures and band of an export whose folder is `folder` are there.
  static bool AreThere(const std::string& folder);
  static std::string FolderIn(const std::string& folder) { return folder + "/pictures"; }

  // Draws into `material.pictures` and asks for the band what is not there yet, unless another
  // thread does it for this export: then it waits. `queued.attempts` says how often it was tried.
  //
  // Returns the band in mm, #V numbers; none, with a warning, too, where the server cannot
  // give one. Errors: Unavailable or another that MayCome names: to be tried again; the rest stays.
  absl::StatusOr<std::vector<double>> Make(const QueuedExport& queued,
                                           const ExportMaterial& material)
      ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  absl::StatusOr<std::vector<double>> BandOf(const QueuedExport& queued,
                                             const ExportMaterial& material);
  absl::StatusOr<std::vector<double>> AskBand(const QueuedExport& queued,
                                              const ExportMaterial& material);

  CaseServer* const server_;
  ObjectWriter* const writer_;
  const std::function<void(const std::string& line)> warn_;

  Mutex mutex_;
  ConditionVariable made_;
  std::set<std::string> making_ ABSL_GUARDED_BY(mutex_);  // exports that a thread works on
};

}  // namespace tissueform
