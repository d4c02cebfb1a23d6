// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/builds/build_room.h"

#include <filesystem>
#include <system_error>

#include "core/base/status_macros.h"
#include "server/builds/plan_builder.h"
#include "server/platform/storage/durable_file.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<BuildRoom>> BuildRoom::Open(std::string folder,
                                                           const PlanBuildLimits& limits,
                                                           int threads, CaseStore* cases,
                                                           int max_cases) {
  std::string temporary;
  if (folder.empty()) {
    TF_ASSIGN_OR_RETURN(temporary, MakeTemporaryFolder("tissueform-builds"));
    folder = temporary;
  }
  std::unique_ptr<BuildRoom> room(new BuildRoom(std::move(temporary)));
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  TF_ASSIGN_OR_RETURN(room->files_, BuildFiles::Open(folder + "/files", limits));
  TF_ASSIGN_OR_RETURN(room->drafts_,
                      BuildDrafts::Open(folder + "/drafts", limits, room->files_.get()));
  const auto work = [limits, files = room->files_.get(), cases,
                     max_cases](const PlanBuildJob& job) {
    return BuildPlanOf(job, limits, files, cases, max_cases);
  };
  TF_ASSIGN_OR_RETURN(room->builds_,
                      PlanBuilds::Open(folder + "/plans", limits, threads, room->files_.get(),
                                       room->drafts_.get(), work));
  return room;
}

BuildRoom::~BuildRoom() {
  builds_.reset();
  std::error_code ignored;
  if (!temporary_.empty()) std::filesystem::remove_all(temporary_, ignored);
}

}  // namespace tissueform
