// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <utility>

#include "absl/status/statusor.h"

#include "server/builds/build_drafts.h"
#include "server/builds/build_files.h"
#include "server/builds/build_limits.h"
#include "server/builds/plan_builds.h"
#include "server/store/case_store.h"

namespace tissueform {

// The plans that a server builds, with the files that they are built from, in one folder.
class BuildRoom {
 public:
  // `folder` empty: a new one below the system's temporary folder, which goes with this object.
  // `threads`: of one build. `cases` must outlive it. Errors: what the disk says.
  static absl::StatusOr<std::unique_ptr<BuildRoom>> Open(std::string folder,
                                                         const PlanBuildLimits& limits, int threads,
                                                         CaseStore* cases, int max_cases);
  ~BuildRoom();
  BuildRoom(const BuildRoom&) = delete;
  BuildRoom& operator=(const BuildRoom&) = delete;

  BuildFiles* files() { return files_.get(); }
  BuildDrafts* drafts() { return drafts_.get(); }
  PlanBuilds* builds() { return builds_.get(); }

 private:
  explicit BuildRoom(std::string temporary) : temporary_(std::move(temporary)) {}

  const std::string temporary_;  // empty: the folder stays
  std::unique_ptr<BuildFiles> files_;
  std::unique_ptr<BuildDrafts> drafts_;
  std::unique_ptr<PlanBuilds> builds_;
};

}  // namespace tissueform
