// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/ct/dicom_series.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using Series = std::map<std::string, std::vector<DicomHeader>>;

bool IsCt(const DicomHeader& header) { return header.kind == DicomKind::kCtSlice; }

std::string NumberOf(const std::vector<DicomHeader>& series) {
  const std::optional<int> number = series.front().series_number;
  return number ? absl::StrCat("series ", *number) : "a series without number";
}

std::string Describe(const std::vector<DicomHeader>& series) {
  const auto slices = std::count_if(series.begin(), series.end(), IsCt);
  if (slices > 0) return absl::StrCat(NumberOf(series), " (", slices, " slices)");
  return absl::StrCat(NumberOf(series), " (", series.size(), " files; the first is ",
                      DescribeKind(series.front()), ")");
}

std::string DescribeAll(const std::vector<const std::vector<DicomHeader>*>& all) {
  constexpr size_t kMostListed = 20;
  std::vector<std::string> names;
  for (size_t i = 0; i < std::min(all.size(), kMostListed); ++i) names.push_back(Describe(*all[i]));
  if (all.size() > kMostListed) names.push_back(absl::StrCat(all.size() - kMostListed, " more"));
  return absl::StrJoin(names, ", ");
}

bool IsWanted(const std::vector<DicomHeader>& series, const SeriesChoice& choice) {
  if (!choice.series_uid.empty()) return series.front().series_uid == choice.series_uid;
  if (choice.series_number) return series.front().series_number == choice.series_number;
  return std::any_of(series.begin(), series.end(), IsCt);
}

absl::Status NoneWanted(const std::vector<const std::vector<DicomHeader>*>& all,
                        const SeriesChoice& choice) {
  if (choice.series_number) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the folder has no series ", *choice.series_number, "; it holds ", DescribeAll(all)));
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the folder holds no CT slices, only ", DescribeAll(all)));
}

absl::Status SeveralWanted(const std::vector<const std::vector<DicomHeader>*>& wanted) {
  return absl::InvalidArgumentError(
      absl::StrCat("the folder holds ", wanted.size(), " CT series: ", DescribeAll(wanted),
                   "; choose one with \"series_number\" in the recipe, or name one of its files"));
}

absl::Status CheckKinds(const std::vector<DicomHeader>& slices) {
  for (const DicomHeader& slice : slices) {
    if (!IsCt(slice)) {
      return absl::InvalidArgumentError(
          absl::StrCat(NameOf(slice), " is not a CT slice but ", DescribeKind(slice)));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<DicomStack> ChooseSeries(const std::vector<DicomHeader>& files,
                                        const SeriesChoice& choice) {
  Series by_uid;
  for (const DicomHeader& file : files) {
    if (file.kind != DicomKind::kDirectory) by_uid[file.series_uid].push_back(file);
  }
  std::vector<const std::vector<DicomHeader>*> all;
  std::vector<const std::vector<DicomHeader>*> wanted;
  for (const auto& [uid, series] : by_uid) all.push_back(&series);
  // Identifiers of series are random: numbers and names of files give the order.
  std::sort(all.begin(), all.end(), [](const auto* a, const auto* b) {
    return std::pair(a->front().series_number, a->front().file_number) <
           std::pair(b->front().series_number, b->front().file_number);
  });
  std::copy_if(all.begin(), all.end(), std::back_inserter(wanted),
               [&](const auto* series) { return IsWanted(*series, choice); });
  if (wanted.empty()) return NoneWanted(all, choice);
  if (wanted.size() > 1) return SeveralWanted(wanted);
  DicomStack stack;
  stack.slices = *wanted.front();
  TF_RETURN_IF_ERROR(CheckKinds(stack.slices));
  const auto lossy = std::count_if(stack.slices.begin(), stack.slices.end(),
                                   [](const DicomHeader& slice) { return slice.was_lossy; });
  if (lossy > 0) {
    stack.notes.push_back(absl::StrCat(lossy, " slices were once compressed with loss"));
  }
  std::erase(all, wanted.front());
  if (!all.empty()) stack.notes.push_back(absl::StrCat("left aside: ", DescribeAll(all)));
  return stack;
}

}  // namespace tissueform
