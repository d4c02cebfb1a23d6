// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/plan_report.h"

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/planning/plan_report/plan_measures.h"
#include "core/planning/plan_report/plan_pictures.h"
#include "core/planning/plan_report/report_html.h"
#include "core/planning/plan_report/report_json.h"

namespace tissueform {
namespace {

absl::StatusOr<std::vector<ReportPicture>> Draw(const PlanBuild& build,
                                                const PlanMeasures& measures,
                                                const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directory(folder, error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot create the folder ", folder.string(), ": ", error.message()));
  }
  return DrawPlanPictures(build, measures, folder.string());
}

}  // namespace

absl::Status WritePlanReport(const PlanBuild& build, const PlanReportOptions& options,
                             const std::string& folder) {
  const std::filesystem::path root = folder;
  const PlanMeasures measures = MeasurePlan(build);
  std::vector<ReportPicture> pictures;
  if (options.pictures) {
    ReportStage(options.on_stage, "drawing the pictures", 0);
    TF_ASSIGN_OR_RETURN(pictures, Draw(build, measures, root / "pictures"));
  }
  ReportStage(options.on_stage, "writing the report", 0.9);
  const nlohmann::ordered_json report =
      PlanReportJson(build, measures, options.program_version, pictures);
  TF_RETURN_IF_ERROR(WriteFileAtomically((root / "report.json").string(), report.dump(2) + "\n"));
  return WriteFileAtomically((root / "report.html").string(), PlanReportHtml(report, pictures));
}

}  // namespace tissueform
