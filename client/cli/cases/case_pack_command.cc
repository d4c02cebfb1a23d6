// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/cases/case_pack_command.h"

#include <filesystem>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/cases/packed_case.h"
#include "client/cli/shared/option_checks.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/case_file/viewer_file.h"
#include "core/planning/plan_io.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

struct CasePackOptions {
  std::string plan;
  PlanReadOptions reading;
  std::string out;
  std::string title;
  bool overwrite = false;
};

// What planners keep beside a case (names, predictions) refers to it by its digest: unlike a result
// it is not replaced because its name was given again.
absl::Status CheckCaseOut(const CasePackOptions& options) {
  TF_RETURN_IF_ERROR(CheckWritable(options.out));
  std::error_code ignored;
  if (fs::exists(options.out, ignored) && !options.overwrite) {
    return absl::FailedPreconditionError(
        absl::StrCat("--out ", options.out, " exists; name another file, or give --overwrite"));
  }
  return absl::OkStatus();
}

absl::Status PackCase(const CasePackOptions& options) {
  TF_RETURN_IF_ERROR(CheckCaseOut(options));
  TF_ASSIGN_OR_RETURN(const PackedCase packed,
                      PackPlan(options.plan, options.reading, options.title));
  const auto& [contents, bytes] = packed;
  TF_RETURN_IF_ERROR(WriteFileAtomically(options.out, bytes));
  absl::PrintF("cases/%s\n", Sha256Hex({bytes}));
  for (const CaseSurface& surface : contents.surfaces) {
    absl::PrintF("%-10s %-16s %7d triangles\n", SurfaceKindName(surface.kind), surface.name,
                 surface.triangles.rows());
  }
  if (contents.landmarks.empty()) {
    absl::PrintF("no %s in the mesh's folder: using the mesh's own surfaces, without landmarks\n",
                 kViewerFile);
  }
  absl::PrintF("%d handles, %d landmarks, head frame by %s, %.1f MB: %s\n", contents.handles.size(),
               contents.landmarks.size(), contents.head_frame.source,
               static_cast<double>(bytes.size()) * 1e-6, options.out);
  return absl::OkStatus();
}

constexpr char kCasePackFooter[] =
    "A case is one file for the planner: surfaces, mesh, session, poses, landmarks. "
    "It is a\nbinary glTF 2.0 file, so other programs can show it; see docs/case-format.md.\n\n"
    "It shows the patient's face: treat it like the CT. Not a medical device.\n\n"
    "Examples:\n"
    "  tissueform case pack head/plan.json --out head.tfcase --title \"Lower jaw forward\"\n"
    "Exit codes: 0 done, 1 the work failed, 2 wrong use.";

}  // namespace

void AddCasePackCommand(CLI::App& command, CommandWork* work) {
  auto options = std::make_shared<CasePackOptions>();
  CLI::App* pack = command.add_subcommand("pack", "create a case from a plan");
  pack->add_option("PLAN", options->plan, "the plan file (docs/plan-format.md)")->required();
  pack->add_option("--out", options->out, "the case to write, NAME.tfcase")->required();
  pack->add_option("--title", options->title, "name shown by the planner (default: the segments)");
  pack->add_flag("--overwrite", options->overwrite, "replace an existing file");
  AddPlanOptions(pack, &options->reading);
  pack->footer(kCasePackFooter);
  pack->callback([options, work] { *work = [options] { return PackCase(*options); }; });
}

}  // namespace tissueform
