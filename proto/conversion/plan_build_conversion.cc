// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/plan_build_conversion.h"

#include <algorithm>
#include <set>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/case_conversion.h"

namespace tissueform {
namespace {

constexpr absl::string_view kFilePrefix = "buildFiles/";
constexpr absl::string_view kBuildPrefix = "planBuilds/";
constexpr absl::string_view kDraftPrefix = "buildDrafts/";
constexpr size_t kMaxIdBytes = 64;
constexpr size_t kMaxPathBytes = 128;
constexpr int kMaxTitleBytes = 256;
constexpr size_t kMaxRequestIdBytes = 64;
constexpr char kRecipeFile[] = "recipe.json";  // where the recipe itself lies

bool IsPlainPart(absl::string_view part) {
  return !part.empty() && part != "." && part != ".." &&
         std::all_of(part.begin(), part.end(), [](unsigned char c) {
           return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == '-';
         });
}

bool IsPlainPath(absl::string_view path) {
  const std::vector<absl::string_view> parts = absl::StrSplit(path, '/');
  return path.size() <= kMaxPathBytes && path != kRecipeFile &&
         std::all_of(parts.begin(), parts.end(), IsPlainPart);
}

absl::Status CheckRecipeFiles(const v1::CreatePlanBuildRequest& request) {
  if (request.recipe_files_size() > kMaxRecipeFiles) {
    return absl::InvalidArgumentError(absl::StrCat("the recipe has ", request.recipe_files_size(),
                                                   " files; the limit is ", kMaxRecipeFiles));
  }
  std::set<absl::string_view> paths;
  for (int i = 0; i < request.recipe_files_size(); ++i) {
    const v1::RecipeFile& file = request.recipe_files(i);
    const std::string where = absl::StrCat("recipe_files[", i, "]");
    if (!IsPlainPath(file.path())) {
      return absl::InvalidArgumentError(absl::StrCat(
          where, ".path is not plain: use letters, digits, \".\", \"_\" and \"-\", at most ",
          kMaxPathBytes, " bytes, with \"/\" between folders, and not ", kRecipeFile));
    }
    if (!paths.insert(file.path()).second) {
      return absl::InvalidArgumentError(absl::StrCat(where,
                                                     ".path names a file that another one "
                                                     "of the recipe has; rename one"));
    }
    TF_RETURN_IF_ERROR(ParseBuildFileName(file.file()).status());
  }
  // A folder cannot have the name of a file.
  for (const absl::string_view path : paths) {
    const auto next = paths.upper_bound(path);
    if (next != paths.end() && absl::StartsWith(*next, absl::StrCat(path, "/"))) {
      return absl::InvalidArgumentError(
          "a path of recipe_files is a file and a folder; rename one");
    }
  }
  return absl::OkStatus();
}

absl::Status CheckRecipeLength(const std::string& recipe_json) {
  if (recipe_json.size() <= kMaxBuildRecipeBytes) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("the recipe has ", recipe_json.size(),
                                                 " bytes; the limit is ", kMaxBuildRecipeBytes));
}

absl::Status CheckDraftInputs(const v1::CreatePlanBuildRequest& request) {
  TF_RETURN_IF_ERROR(ParseBuildDraftName(request.draft()).status());
  if (!request.ct().empty() || !request.surfaces().empty() || request.recipe_json().empty()) {
    return absl::InvalidArgumentError(
        "a draft has its own CT: give a recipe (recipe_json) with it, and neither ct nor surfaces");
  }
  return request.labels().empty() ? absl::OkStatus()
                                  : ParseBuildFileName(request.labels()).status();
}

bool ConsumeId(absl::string_view prefix, absl::string_view* name) {
  return absl::ConsumePrefix(name, prefix) && !name->empty() && name->size() <= kMaxIdBytes &&
         std::all_of(name->begin(), name->end(),
                     [](unsigned char c) { return absl::ascii_isalnum(c) || c == '-'; });
}

absl::Status CheckInputs(const v1::CreatePlanBuildRequest& request) {
  if (!request.draft().empty()) return CheckDraftInputs(request);
  const bool has_surfaces = !request.surfaces().empty();
  const bool has_ct = !request.ct().empty() || !request.recipe_json().empty();
  if (has_surfaces == has_ct) {
    return absl::InvalidArgumentError("give a CT with a recipe, or surfaces, and not both");
  }
  if (has_surfaces) return ParseBuildFileName(request.surfaces()).status();
  if (request.ct().empty() || request.recipe_json().empty()) {
    return absl::InvalidArgumentError("a CT needs a recipe (recipe_json), and a recipe a CT (ct)");
  }
  TF_RETURN_IF_ERROR(ParseBuildFileName(request.ct()).status());
  return request.labels().empty() ? absl::OkStatus()
                                  : ParseBuildFileName(request.labels()).status();
}

}  // namespace

std::string BuildFileName(absl::string_view sha256) { return absl::StrCat(kFilePrefix, sha256); }

absl::StatusOr<std::string> ParseBuildFileName(absl::string_view name) {
  if (!absl::ConsumePrefix(&name, kFilePrefix) || !IsSha256Hex(name)) {
    return absl::InvalidArgumentError(
        "invalid name of a build file; use \"buildFiles/{sha256}\" with the digest of the file in "
        "64 lower-case hexadecimal digits");
  }
  return std::string(name);
}

std::string PlanBuildName(absl::string_view id) { return absl::StrCat(kBuildPrefix, id); }

absl::StatusOr<std::string> ParsePlanBuildName(absl::string_view name) {
  if (ConsumeId(kBuildPrefix, &name)) return std::string(name);
  return absl::InvalidArgumentError(
      "invalid name of a plan build; use \"planBuilds/{id}\" as CreatePlanBuild answers it");
}

std::string BuildDraftName(absl::string_view id) { return absl::StrCat(kDraftPrefix, id); }

absl::StatusOr<std::string> ParseBuildDraftName(absl::string_view name) {
  if (ConsumeId(kDraftPrefix, &name)) return std::string(name);
  return absl::InvalidArgumentError(
      "invalid name of a draft; use \"buildDrafts/{id}\" as ListBuildDrafts answers it");
}

absl::Status CheckBuildDraftRequest(const v1::CreateBuildDraftRequest& request) {
  TF_RETURN_IF_ERROR(ParseBuildFileName(request.ct()).status());
  TF_RETURN_IF_ERROR(CheckRecipeLength(request.recipe_json()));
  return CheckTitle(request.title(), kMaxTitleBytes);
}

absl::Status CheckPlanBuildRequest(const v1::CreatePlanBuildRequest& request) {
  TF_RETURN_IF_ERROR(CheckInputs(request));
  TF_RETURN_IF_ERROR(CheckRecipeLength(request.recipe_json()));
  if (request.request_id().size() > kMaxRequestIdBytes) {
    return absl::InvalidArgumentError(absl::StrCat("request_id has ", request.request_id().size(),
                                                   " bytes; the limit is ", kMaxRequestIdBytes));
  }
  TF_RETURN_IF_ERROR(CheckTitle(request.title(), kMaxTitleBytes));
  return CheckRecipeFiles(request);
}

}  // namespace tissueform
