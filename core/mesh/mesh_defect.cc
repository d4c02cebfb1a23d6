// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/mesh_defect.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace tissueform {

void AddDefect(const DefectWords& words, const std::vector<Eigen::Index>& found,
               std::vector<MeshDefect>* defects) {
  if (found.empty()) return;
  MeshDefect defect;
  defect.kind = words.kind;
  defect.severity = words.severity;
  defect.count = static_cast<Eigen::Index>(found.size());
  const size_t shown = std::min(found.size(), MeshDefect::kMaxExamples);
  defect.examples.assign(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(shown));
  defect.explanation = absl::StrCat(defect.count, " ", words.what, " (", words.noun, " ",
                                    absl::StrJoin(defect.examples, ", "),
                                    found.size() > shown ? ", ..." : "", "): ", words.advice);
  defects->push_back(std::move(defect));
}

bool AreUsable(const std::vector<MeshDefect>& defects) {
  return std::none_of(defects.begin(), defects.end(),
                      [](const MeshDefect& d) { return d.severity == Severity::kError; });
}

const MeshDefect* FindDefect(const std::vector<MeshDefect>& defects, std::string_view kind) {
  const auto found = std::find_if(defects.begin(), defects.end(),
                                  [&](const MeshDefect& d) { return d.kind == kind; });
  return found == defects.end() ? nullptr : &*found;
}

absl::Status CheckDefects(const std::vector<MeshDefect>& defects) {
  const auto is_error = [](const MeshDefect& d) { return d.severity == Severity::kError; };
  const auto first = std::find_if(defects.begin(), defects.end(), is_error);
  if (first == defects.end()) return absl::OkStatus();
  std::string message = absl::StrCat("mesh is not usable: ", first->explanation);
  const auto further = std::count_if(first + 1, defects.end(), is_error);
  if (further > 0) {
    absl::StrAppend(&message, " (and ", further, " more kinds of defect; see `mesh check`)");
  }
  return absl::InvalidArgumentError(message);
}

}  // namespace tissueform
