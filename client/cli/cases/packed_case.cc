// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/cases/packed_case.h"

#include <cstdio>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

#include "client/cli/cases/plan_case.h"
#include "client/cli/session/upload_lines.h"
#include "core/base/json/json_file.h"
#include "core/base/software_version.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/case_file/case_writer.h"
#include "core/planning/case_file/viewer_file.h"

namespace tissueform {
namespace {

// Of the segments, for a folder may be named after a patient.
std::string TitleOf(const CaseFile& contents) {
  const auto add_label = [](std::string* text, const CaseHandle& h) { *text += h.label; };
  return absl::StrJoin(contents.handles, ", ", add_label).substr(0, 256);
}

MeshPayloadView PayloadOf(const CaseMesh& mesh) {
  return {.shape = {mesh.vertex_count, mesh.tet_count, mesh.cell_arrays},
          .segments = {mesh.payload}};
}

}  // namespace

absl::StatusOr<OpenedPlan> OpenPlan(const std::string& plan_path, const PlanReadOptions& reading,
                                    const std::string& title) {
  TF_ASSIGN_OR_RETURN(const std::string text, ReadJsonText(plan_path, "plan", kMaxPlanBytes));
  TF_ASSIGN_OR_RETURN(const Plan plan, ReadPlan(plan_path, reading));
  TF_ASSIGN_OR_RETURN(PlanProblem problem, ResolvePlan(plan, reading.resolve));
  TF_ASSIGN_OR_RETURN(std::optional<ViewerFile> viewer, FindViewerOf(plan.mesh_path));
  CaseFile about;
  about.title = title;
  about.software = absl::StrCat("tissueform ", SoftwareVersion());
  about.commit = SoftwareCommit();
  about.created = absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", absl::Now(), absl::UTCTimeZone());
  about.plan_sha256 = Sha256Hex({text});
  TF_ASSIGN_OR_RETURN(CaseFile contents, CaseOfPlan(problem, std::move(about), std::move(viewer)));
  return OpenedPlan{.problem = std::move(problem), .contents = std::move(contents)};
}

absl::StatusOr<PackedCase> PackPlan(const std::string& plan_path, const PlanReadOptions& reading,
                                    const std::string& title) {
  TF_ASSIGN_OR_RETURN(OpenedPlan opened, OpenPlan(plan_path, reading, title));
  PackedCase packed = {.contents = std::move(opened.contents), .bytes = {}};
  if (packed.contents.title.empty()) packed.contents.title = TitleOf(packed.contents);
  TF_ASSIGN_OR_RETURN(packed.bytes, SerializeCase(packed.contents));
  return packed;
}

absl::StatusOr<v1::Case> PublishCase(TissueformClient* client, const CaseFile& contents,
                                     const std::string& bytes, const std::string& title) {
  const Stopwatch stopwatch;
  const auto print = [](const std::string& line) { absl::FPrintF(stderr, "%s\n", line); };
  const auto seconds = [&stopwatch] { return stopwatch.Seconds(); };
  UploadLines mesh_lines(print, seconds);
  TF_RETURN_IF_ERROR(client->UploadMesh(PayloadOf(contents.mesh), mesh_lines.Options()).status());
  UploadLines case_lines(print, seconds);
  return client->cases().Upload(bytes, title, case_lines.Options());
}

}  // namespace tissueform
