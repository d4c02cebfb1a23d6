// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/cohort_record.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "nlohmann/json.hpp"

#include "core/base/atomic_file.h"
#include "core/base/json/json_file.h"
#include "core/base/software_version.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/case_file/viewer_file.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMaxJsonBytes = size_t{16} << 20;

using NamedPath = std::pair<const char*, std::string>;

std::array<NamedPath, 5> PathsOf(const CohortCase& row) {
  return {{{"pre", row.pre},
           {"post", row.post},
           {"post_bone", row.post_bone},
           {"post_labels", row.post_labels},
           {"post_recipe", row.post_recipe}}};
}

std::string StateOf(const fs::path& file) {
  std::error_code error;
  const auto size = fs::file_size(file, error);
  const auto time = fs::last_write_time(file, error).time_since_epoch().count();
  return absl::StrCat(file.string(), " ", size, " ", time);
}

nlohmann::json ParseFile(const std::string& path) {
  const absl::StatusOr<std::string> text = ReadJsonText(path, "JSON", kMaxJsonBytes);
  return text.ok() ? nlohmann::json::parse(*text, nullptr, false) : nlohmann::json();
}

// A plan's mesh, and the viewer file beside that.
void AddFilesOfPlan(const fs::path& plan, std::vector<std::string>* states) {
  const nlohmann::json json = ParseFile(plan.string());
  if (!json.is_object() || !json.contains("mesh") || !json["mesh"].is_string()) return;
  const fs::path mesh = plan.parent_path() / json["mesh"].get<std::string>();
  states->push_back(StateOf(mesh));
  states->push_back(StateOf(mesh.parent_path() / kViewerFile));
}

void AddFolder(const fs::path& folder, std::vector<std::string>* states) {
  std::error_code error;
  for (fs::recursive_directory_iterator file(folder, error), end; !error && file != end;
       file.increment(error)) {
    if (file->is_regular_file(error)) states->push_back(StateOf(file->path()));
  }
}

void AddFilesOfSameName(const fs::path& path, std::vector<std::string>* states) {
  std::error_code error;
  for (fs::directory_iterator file(path.parent_path(), error), end; !error && file != end;
       file.increment(error)) {
    const bool is_its = file->path().stem() == path.stem() && file->is_regular_file(error);
    if (is_its) states->push_back(StateOf(file->path()));
  }
}

std::string HashOfFiles(const CohortCase& row) {
  std::string text = row.post_axes;
  for (const auto& [name, path] : PathsOf(row)) {
    if (path.empty()) continue;
    std::vector<std::string> states;
    std::error_code error;
    if (fs::is_directory(path, error)) {
      AddFolder(path, &states);
    } else {
      AddFilesOfSameName(path, &states);
      if (absl::EndsWithIgnoreCase(path, ".json")) AddFilesOfPlan(path, &states);
    }
    std::ranges::sort(states);  // folders list their files in any order
    absl::StrAppend(&text, "\n", name, "\n", absl::StrJoin(states, "\n"));
  }
  return Sha256Hex({text});
}

// `prefix` becomes `name` wherever it is in `text`, with what follows up to a punctuation mark
// where the path goes on.
void ReplacePath(const std::string& prefix, const char* name, std::string* text) {
  if (prefix.size() < 2) return;
  for (size_t at = 0; (at = text->find(prefix, at)) != std::string::npos;) {
    size_t end = at + prefix.size();
    const bool goes_on = prefix.back() == '/' ||
                         (end < text->size() && !absl::StrContains(" :;,\"')", (*text)[end]));
    if (goes_on) end = std::min(text->find_first_of(":;,\"", end), text->size());
    text->replace(at, end - at, name);
    at += std::string(name).size();
  }
}

}  // namespace

CohortRecord RecordOf(const CohortCase& row, const std::vector<std::string>& options) {
  return {.inputs = HashOfFiles(row),
          .options = options,
          .software = absl::StrCat(SoftwareVersion(), " ", SoftwareCommit())};
}

absl::Status WriteRecord(const std::string& path, const CohortRecord& record) {
  const nlohmann::ordered_json json = {{"format", "tissueform-cohort-case"},
                                       {"version", 1},
                                       {"software", record.software},
                                       {"options", record.options},
                                       {"inputs_sha256", record.inputs}};
  return WriteFileAtomically(path, json.dump(2) + "\n");
}

std::string ReasonToRepeat(const std::string& path, const CohortRecord& record) {
  const nlohmann::json json = ParseFile(path);
  if (!json.is_object()) return "it has no finished result";
  if (json.value("software", nlohmann::json()) != record.software) {
    return "another program version made its result";
  }
  if (json.value("options", nlohmann::json()) != nlohmann::json(record.options)) {
    return "its result has other options";
  }
  if (json.value("inputs_sha256", nlohmann::json()) != record.inputs) return "its inputs changed";
  return "";
}

std::string WithoutPaths(absl::string_view message, const CohortCase& row) {
  std::string text(message);
  for (const auto& [name, path] : PathsOf(row)) {
    if (!path.empty()) ReplacePath(path, name, &text);
  }
  for (const auto& [name, path] : PathsOf(row)) {
    if (!path.empty()) ReplacePath(fs::path(path).parent_path().string() + "/", name, &text);
  }
  return text;
}

}  // namespace tissueform
