// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/export/export_command.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/export/exported_face.h"
#include "client/cli/export/page_template.h"
#include "client/cli/export/sealed_payload.h"
#include "client/cli/shared/companion.h"
#include "client/cli/shared/option_checks.h"
#include "core/base/atomic_file.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr int kOwnerOnlyMode = 0600;
constexpr size_t kMaxTitleBytes = 256;

struct ExportOptions {
  std::string plan;
  PlanReadOptions reading;
  std::string html;
  std::string password_file;
  ExportedFaceOptions face;
  bool overwrite = false;
};

// Before the long work.
absl::Status CheckExport(const ExportOptions& options) {
  if (fs::path(options.html).extension() != ".html") {
    return absl::InvalidArgumentError(absl::StrCat(
        "--html ", options.html, " must end in .html, or no browser opens it as a page"));
  }
  TF_RETURN_IF_ERROR(CheckWritable(options.html));
  std::error_code ignored;
  if (fs::exists(options.html, ignored) && !options.overwrite) {
    return absl::FailedPreconditionError(
        absl::StrCat("--html ", options.html, " exists; name another file, or give --overwrite"));
  }
  const std::string& title = options.face.title;
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20; };
  if (title.size() > kMaxTitleBytes || std::any_of(title.begin(), title.end(), is_control)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--title must be one line of at most ", kMaxTitleBytes, " bytes"));
  }
  return absl::OkStatus();
}

absl::Status Export(const ExportOptions& options) {
  TF_RETURN_IF_ERROR(CheckExport(options));
  TF_ASSIGN_OR_RETURN(const std::string page, ReadPageTemplate());
  std::string password;
  if (!options.password_file.empty()) {
    TF_ASSIGN_OR_RETURN(password, ReadPasswordFile(options.password_file));
  }
  if (!options.face.title.empty()) {
    absl::FPrintF(stderr,
                  "--title is stored in the file: make sure that it does not name the patient%s\n",
                  password.empty() ? "; anyone who has the file can read it" : "");
  }
  TF_ASSIGN_OR_RETURN(OpenedPlan opened, OpenPlan(options.plan, options.reading, ""));
  TF_ASSIGN_OR_RETURN(const MovingData data, ExportFace(std::move(opened), options.face));
  TF_ASSIGN_OR_RETURN(const SealedPayload sealed, SealPayload(WriteMovingData(data), password));
  TF_ASSIGN_OR_RETURN(const std::string html, FillPageTemplate(page, sealed));
  TF_RETURN_IF_ERROR(WriteFileAtomically(options.html, html, kOwnerOnlyMode));
  absl::PrintF("%s, %d surfaces, %.1f MB, %s: %s\n", data.model, data.surfaces.size(),
               static_cast<double>(html.size()) * 1e-6,
               password.empty() ? "not encrypted" : "encrypted", options.html);
  absl::PrintF(
      "not a medical device; the file shows an identifiable face: treat it like a photograph of "
      "the patient\n");
  return absl::OkStatus();
}

constexpr char kExportFooter[] =
    "The file is a web page that opens in a browser from disk, without a network. Sliders move the "
    "bone within the limits of the case;\nthe face follows, from prepared answers of the model "
    "(docs/moving-file.md). The file\ncontains no name, date or identifier, but it shows the face: "
    "treat it "
    "like a photograph of the patient. Not a\nmedical device.\n\n"
    "With --password-file it is encrypted (AES-256-GCM, PBKDF2 with SHA-256, 600,000 rounds): "
    "without the\npassword, which cannot be recovered, only the notice is readable. The password "
    "is the line's\nexact bytes; an accented letter may be one or two characters, and the page "
    "accepts both.\n\n"
    "Examples:\n"
    "  tissueform export head/plan.json --html face.html\n"
    "  tissueform export head/plan.json --html face.html --model linear_elastic --segments chin\n"
    "Exit codes: 0 done, 1 the work failed, 2 wrong use.";

}  // namespace

void AddExportCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<ExportOptions>();
  CLI::App* command = app.add_subcommand(kExportCommand.name, kExportCommand.description);
  command->add_option("PLAN", options->plan, "the plan file (docs/plan-format.md)")->required();
  command->add_option("--html", options->html, "the file to write, NAME.html")->required();
  command->add_option("--model", options->face.model,
                      "gradient_field, linear_elastic or neo_hookean (default: the plan's model)");
  command
      ->add_option("--segments", options->face.segments,
                   "the handles that get sliders, separated by commas; the others stay in the "
                   "plan's pose (default: all)")
      ->delimiter(',');
  command->add_option("--password-file", options->password_file,
                      "encrypt with the password in the first line of this file");
  command->add_option(
      "--title", options->face.title,
      "heading above the picture (default: none, because it could name the patient)");
  command->add_flag("--overwrite", options->overwrite, "replace an existing file");
  AddPlanOptions(command, &options->reading);
  command->footer(kExportFooter);
  command->callback([options, work] { *work = [options] { return Export(*options); }; });
}

}  // namespace tissueform
