// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/dicom_series.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/imaging/ct/slice_acquisitions.h"
#include "core/imaging/ct/slice_groups.h"
#include "core/imaging/series/series_facts.h"
#include "core/imaging/series/series_objections.h"
#include "core/imaging/series/series_pick.h"
#include "core/imaging/series/series_rules.h"

namespace tissueform {
namespace {

// What a folder holds that may be one CT.
struct Candidate {
  SliceGroup group;
  std::vector<Acquisition> scans;  // of the group, parted; the first is meant
};

bool IsCt(const DicomHeader& header) { return header.kind == DicomKind::kCtSlice; }

bool HasCt(const SliceGroup& group) {
  return std::any_of(group.slices.begin(), group.slices.end(), IsCt);
}

std::string NumberOf(const SliceGroup& group) {
  const std::optional<int> number = group.slices.front().series_number;
  return number ? absl::StrCat("series ", *number) : "a series without number";
}

std::string Describe(const SliceGroup& group) {
  const auto slices = std::count_if(group.slices.begin(), group.slices.end(), IsCt);
  if (slices > 0) return absl::StrCat(NumberOf(group), " (", slices, " slices)");
  return absl::StrCat(NumberOf(group), " (", group.slices.size(), " files; the first is ",
                      DescribeKind(group.slices.front()), ")");
}

// All of a few; of many how many there are, and the largest.
std::string DescribeAll(std::vector<SliceGroup> groups) {
  constexpr size_t kMaxListed = 3;
  std::string text;
  if (groups.size() > kMaxListed) {
    size_t images = 0;
    for (const SliceGroup& group : groups) images += group.slices.size();
    if (images == groups.size()) return absl::StrCat(images, " series of one image each");
    absl::StrAppend(&text, groups.size(), " series with ", images, " images in all, the largest ");
    std::stable_sort(groups.begin(), groups.end(), [](const SliceGroup& a, const SliceGroup& b) {
      return a.slices.size() > b.slices.size();
    });
    groups.resize(kMaxListed);
  }
  return text + absl::StrJoin(groups, ", ", [](std::string* out, const SliceGroup& group) {
           absl::StrAppend(out, Describe(group));
         });
}

// "files 3, 14 and 15 of the folder", of many the first few.
std::string FilesOf(const std::vector<DicomHeader>& slices) {
  constexpr size_t kMaxListed = 8;
  std::set<int> numbers;
  for (const DicomHeader& slice : slices) numbers.insert(slice.file_number);
  std::vector<int> listed(numbers.begin(), numbers.end());
  const size_t more = listed.size() - std::min(listed.size(), kMaxListed);
  listed.resize(listed.size() - more);
  return absl::StrCat(listed.size() > 1 ? "files " : "file ", absl::StrJoin(listed, ", "),
                      more > 0 ? absl::StrCat(" and ", more, " more") : "", " of the folder");
}

std::string HeightsOf(const std::vector<DicomHeader>& slices) {
  const Eigen::Vector3d normal = SliceNormal(slices.front());
  double low = slices.front().position_mm->dot(normal);
  double high = low;
  for (const DicomHeader& slice : slices) {
    low = std::min(low, slice.position_mm->dot(normal));
    high = std::max(high, slice.position_mm->dot(normal));
  }
  return absl::StrFormat("%.1f to %.1f mm along the slices' normal", low, high);
}

std::string DescribeScan(const Acquisition& scan) {
  return absl::StrCat(scan.slices.size(), scan.slices.size() > 1 ? " slices" : " slice",
                      " of another scan lying among the others (told apart by ", scan.separated_by,
                      "): ", FilesOf(scan.slices), ", ", HeightsOf(scan.slices));
}

// Those that are no volume are no choice, if there is one that is; and of a group that is two whole
// scans each is one.
std::vector<Candidate> CandidatesOf(const std::vector<SliceGroup>& groups, JoinSeries join) {
  std::vector<Candidate> candidates;
  for (const SliceGroup& group : groups) {
    const bool part =
        join != JoinSeries::kAlways && std::all_of(group.slices.begin(), group.slices.end(), IsCt);
    std::vector<Acquisition> scans =
        part ? SeparateAcquisitions(group.slices) : std::vector<Acquisition>{{group.slices, ""}};
    const size_t enough = std::max(kLeastSlices, scans.front().slices.size() / 2);
    for (size_t s = 1; s < scans.size(); ++s) {
      if (scans[s].slices.size() < enough) continue;
      candidates.push_back({{scans[s].slices, 1}, {scans[s]}});
      scans.erase(scans.begin() + static_cast<std::ptrdiff_t>(s--));
    }
    candidates.push_back({{scans.front().slices, group.num_series}, std::move(scans)});
  }
  return candidates;
}

bool HoldsFile(const Candidate& candidate, int file_number) {
  const auto is_it = [file_number](const DicomHeader& slice) {
    return slice.file_number == file_number;
  };
  const std::vector<DicomHeader>& slices = candidate.group.slices;
  return std::any_of(slices.begin(), slices.end(), is_it);
}

std::vector<SliceGroup> GroupsOf(const std::vector<Candidate>& candidates) {
  std::vector<SliceGroup> groups;
  groups.reserve(candidates.size());
  for (const Candidate& candidate : candidates) groups.push_back(candidate.group);
  return groups;
}

absl::Status NoneWanted(const std::vector<SliceGroup>& all, const SeriesChoice& choice) {
  if (all.empty()) {
    return absl::InvalidArgumentError(
        "the folder holds no DICOM images, only a directory of them (DICOMDIR); copy the whole "
        "disc, or name the folder that holds the CT series");
  }
  if (choice.series_number) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the folder has no series ", *choice.series_number, "; it holds ", DescribeAll(all)));
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the folder holds no CT slices, only ", DescribeAll(all)));
}

absl::Status NoneIsAVolume(const std::vector<SliceGroup>& groups, JoinSeries join) {
  return absl::InvalidArgumentError(absl::StrCat(
      "the folder holds ", DescribeAll(groups), ", and none has the ", kLeastSlices,
      " slices that a volume needs",
      join == JoinSeries::kNever
          ? "; to read slices of several series as one, leave \"join_series\": \"never\" out of "
            "the recipe"
          : ", also not together: they differ in patient, size, orientation or reconstruction; "
            "name the folder of one scan"));
}

bool MayBeJoined(const std::vector<Candidate>& candidates) {
  for (const Candidate& a : candidates) {
    for (const Candidate& b : candidates) {
      if (&a != &b && !(CanBeOneVolume(a.group, b.group) && AreApart(a.group, b.group))) {
        return false;
      }
    }
  }
  return true;
}

// How the user can select one scan; a file's name does not distinguish several scans in it.
std::string WaysToChoose(const std::vector<Candidate>& candidates) {
  std::set<std::optional<int>> numbers;
  std::set<int> files;
  std::vector<std::string> ways;
  for (const Candidate& candidate : candidates) {
    numbers.insert(candidate.group.slices.front().series_number);
    files.insert(candidate.group.slices.front().file_number);
  }
  if (numbers.size() == candidates.size()) {
    ways.emplace_back("choose one with \"series_number\" in the recipe");
  }
  if (files.size() == candidates.size()) {
    std::vector<int> first_files;
    for (const Candidate& candidate : candidates) {
      if (first_files.size() < 3) first_files.push_back(candidate.group.slices.front().file_number);
    }
    ways.push_back(
        absl::StrCat("choose one by naming one of its files instead of the folder (file ",
                     absl::StrJoin(first_files, ", file "), " in the order of names)"));
  }
  if (candidates.size() <= 8 && MayBeJoined(candidates)) {
    ways.emplace_back("read them as one with \"join_series\": \"always\"");
  }
  return ways.empty() ? "export one scan as a file of its own" : absl::StrJoin(ways, ", or ");
}

// `findings`: what the rule says of them; empty where it does not judge.
absl::Status SeveralWanted(const std::vector<Candidate>& candidates, const std::string& findings) {
  std::set<std::string> patients;
  for (const Candidate& candidate : candidates) {
    patients.insert(candidate.group.slices.front().patient);
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "the folder holds ", candidates.size(), " CT series",
      patients.size() > 1 ? absl::StrCat(" of ", patients.size(), " patients: ") : ": ",
      DescribeAll(GroupsOf(candidates)), findings, "; ", WaysToChoose(candidates)));
}

// The rule measures single-frame CT slices only.
bool IsMeasurable(const Candidate& candidate) {
  const std::vector<DicomHeader>& slices = candidate.scans.front().slices;
  return std::all_of(slices.begin(), slices.end(), [](const DicomHeader& slice) {
    return slice.num_frames == 1 && slice.class_uid == kCtImageClass;
  });
}

// The facts of what would be read.
SeriesFacts FactsOf(const Candidate& candidate) {
  const std::vector<DicomHeader>& slices = candidate.scans.front().slices;
  return FactsOfSeries(NumberOf(candidate.group), {slices.begin(), slices.end()});
}

// Of many the first few.
std::string JoinLines(std::vector<std::string> lines) {
  constexpr size_t kMaxListed = 8;
  if (lines.size() > kMaxListed) {
    const size_t more = lines.size() - kMaxListed;
    lines.resize(kMaxListed);
    lines.push_back(absl::StrCat(more, " more"));
  }
  return absl::StrJoin(lines, "; ");
}

// "series 2: it has 24 slices, fewer than 60; series 5: usable, 231 axial slices, ...".
std::string DescribeFindings(const std::vector<SeriesFacts>& facts, const SeriesRule& rule) {
  std::vector<std::string> lines;
  lines.reserve(facts.size());
  for (const SeriesFacts& series : facts) {
    const std::string against = WhatIsAgainst(series, rule);
    lines.push_back(
        absl::StrCat(series.key, ": ",
                     against.empty() ? absl::StrCat("usable, ", DescribeFacts(series)) : against));
  }
  return JoinLines(std::move(lines));
}

std::string ChoiceNote(const std::vector<SeriesFacts>& facts,
                       const std::vector<SeriesVerdict>& verdicts, size_t chosen) {
  std::vector<std::string> others;
  for (size_t i = 0; i < facts.size(); ++i) {
    if (i != chosen) others.push_back(absl::StrCat(facts[i].key, ": ", verdicts[i].reason));
  }
  return absl::StrCat("chosen of ", facts.size(), " CT series of one study: ", facts[chosen].key,
                      " (", DescribeFacts(facts[chosen]), "); not ", JoinLines(std::move(others)),
                      "; \"series_number\" in the recipe chooses another");
}

// Between what the rule would choose, as it must not; empty where it may choose this one.
std::string ForbiddenChoice(const Candidate& chosen, const std::vector<Candidate>& candidates) {
  const DicomHeader& first = chosen.group.slices.front();
  if (first.study_uid.empty()) return "series that name no study";
  int of_its_number = 0;
  for (const Candidate& candidate : candidates) {
    const DicomHeader& other = candidate.group.slices.front();
    if (other.patient != first.patient) return "patients";
    if (other.study_uid != first.study_uid) return "studies";
    // Half a head, maybe.
    if (CanBeOneVolume(chosen.group, candidate.group) && AreApart(chosen.group, candidate.group)) {
      return "parts that may be one scan";
    }
    of_its_number += other.series_number == first.series_number ? 1 : 0;
  }
  return of_its_number > 1 ? "scans with one series number" : "";
}

// Of several candidates the one that the bridge would choose in their study.
absl::StatusOr<Candidate> ChooseByRule(const std::vector<Candidate>& candidates, bool has_offset,
                                       std::vector<std::string>* notes) {
  if (!std::all_of(candidates.begin(), candidates.end(), IsMeasurable)) {
    return SeveralWanted(candidates, "");
  }
  std::vector<SeriesFacts> facts;
  facts.reserve(candidates.size());
  for (const Candidate& candidate : candidates) facts.push_back(FactsOf(candidate));
  SeriesRule rule;
  rule.hounsfield = !has_offset;
  const std::vector<SeriesVerdict> verdicts = PickSeries(facts, {rule});
  const auto chosen = static_cast<size_t>(
      std::find_if(verdicts.begin(), verdicts.end(),
                   [](const SeriesVerdict& verdict) { return verdict.chosen; }) -
      verdicts.begin());
  const std::string forbidden =
      chosen < verdicts.size() ? ForbiddenChoice(candidates[chosen], candidates) : "";
  if (chosen == verdicts.size() || !forbidden.empty()) {
    return SeveralWanted(
        candidates,
        absl::StrCat("; the default rule ",
                     forbidden.empty() ? "accepts none" : "does not choose between " + forbidden,
                     ": ", DescribeFindings(facts, rule)));
  }
  notes->push_back(ChoiceNote(facts, verdicts, chosen));
  return candidates[chosen];
}

absl::Status NoCtSlice(const DicomHeader& file) {
  return absl::InvalidArgumentError(
      absl::StrCat(NameOf(file), " is not a CT slice but ", DescribeKind(file)));
}

absl::Status CheckKinds(const std::vector<DicomHeader>& slices) {
  const auto other = std::find_if_not(slices.begin(), slices.end(), IsCt);
  return other == slices.end() ? absl::OkStatus() : NoCtSlice(*other);
}

// That the file which stands for its series is one of the series' slices.
absl::Status CheckNamedFile(const std::vector<DicomHeader>& files, int file_number) {
  std::vector<DicomHeader> named;
  std::copy_if(files.begin(), files.end(), std::back_inserter(named),
               [file_number](const DicomHeader& file) { return file.file_number == file_number; });
  if (named.empty() || std::any_of(named.begin(), named.end(), IsCt)) return absl::OkStatus();
  return NoCtSlice(named.front());
}

// Takes out of a series of CT slices what is not a slice: captures, reports or scouts.
// What may be slices that are not read stays, and CheckKinds refuses it.
std::vector<DicomHeader> TakeStrangers(SliceGroup* series) {
  if (!HasCt(*series)) return {};
  const auto first = std::stable_partition(
      series->slices.begin(), series->slices.end(), [](const DicomHeader& object) {
        return IsCt(object) || object.kind == DicomKind::kMultiFrame ||
               object.kind == DicomKind::kDamaged;
      });
  std::vector<DicomHeader> strangers(first, series->slices.end());
  series->slices.erase(first, series->slices.end());
  return strangers;
}

std::string DescribeStrangers(const std::string& series,
                              const std::vector<DicomHeader>& strangers) {
  std::map<std::string, std::vector<DicomHeader>> by_kind;
  for (const DicomHeader& stranger : strangers) by_kind[DescribeKind(stranger)].push_back(stranger);
  return absl::StrCat("ignored in ", series, ", not CT slices: ",
                      absl::StrJoin(by_kind, ", ", [](std::string* out, const auto& kind) {
                        absl::StrAppend(out, FilesOf(kind.second), " (", kind.first, ")");
                      }));
}

// The candidates that are meant, and of those that are whole the others are left aside.
std::vector<Candidate> Wanted(const std::vector<Candidate>& candidates,
                              const SeriesChoice& choice) {
  std::vector<Candidate> wanted;
  for (const Candidate& candidate : candidates) {
    const bool meant = choice.file_number != 0 ? HoldsFile(candidate, choice.file_number)
                                               : candidate.group.slices.size() >= kLeastSlices;
    if (meant) wanted.push_back(candidate);
  }
  return wanted;
}

void AddNotes(const Candidate& chosen, const std::vector<SliceGroup>& aside, DicomStack* stack) {
  const auto lossy = std::count_if(stack->slices.begin(), stack->slices.end(),
                                   [](const DicomHeader& slice) { return slice.was_lossy; });
  if (lossy > 0) {
    stack->notes.push_back(absl::StrCat(lossy, " slices were once compressed with loss"));
  }
  if (stack->slices.front().even_frames) {
    stack->notes.push_back(absl::StrCat(
        "a multi-frame file without a position for each frame: its ", stack->slices.size(),
        " frames are placed by SpacingBetweenSlices (by SliceThickness where that is missing) "
        "along "
        "the normal of the first, toward its positive side; check that the head is not upside "
        "down"));
  }
  if (chosen.group.num_series > 1) {
    stack->notes.push_back(absl::StrCat(
        stack->slices.size(), " slices of ", chosen.group.num_series,
        " series are read as one: they are of one patient, size and orientation, and their places "
        "fit (\"join_series\": \"never\" keeps series apart)"));
  }
  // The largest comes first.
  if (chosen.scans.size() > 1) {
    const size_t more = chosen.scans.size() - 2;
    stack->notes.push_back(
        absl::StrCat("left out: ", DescribeScan(chosen.scans[1]),
                     more > 0 ? absl::StrCat("; and ", more, " more such scans") : ""));
  }
  if (!aside.empty()) stack->notes.push_back(absl::StrCat("ignored: ", DescribeAll(aside)));
}

}  // namespace

absl::StatusOr<DicomStack> ChooseSeries(const std::vector<DicomHeader>& files,
                                        const SeriesChoice& choice) {
  TF_RETURN_IF_ERROR(CheckNamedFile(files, choice.file_number));
  const std::vector<SliceGroup> all = GroupBySeries(files);
  std::vector<SliceGroup> asked;
  std::vector<SliceGroup> aside;
  DicomStack stack;
  for (const SliceGroup& group : all) {
    const bool is_asked = choice.series_number
                              ? group.slices.front().series_number == choice.series_number
                              : HasCt(group);
    (is_asked ? asked : aside).push_back(group);
    if (!is_asked) continue;
    const std::vector<DicomHeader> strangers = TakeStrangers(&asked.back());
    if (!strangers.empty()) stack.notes.push_back(DescribeStrangers(NumberOf(group), strangers));
  }
  if (asked.empty()) return NoneWanted(all, choice);
  const std::vector<Candidate> candidates =
      CandidatesOf(JoinGroups(std::move(asked), choice.join), choice.join);
  std::vector<Candidate> wanted = Wanted(candidates, choice);
  if (wanted.empty() && candidates.size() == 1) wanted = candidates;
  if (wanted.empty()) return NoneIsAVolume(GroupsOf(candidates), choice.join);
  Candidate chosen = wanted.front();
  if (wanted.size() > 1) {
    TF_ASSIGN_OR_RETURN(chosen, ChooseByRule(wanted, choice.has_offset, &stack.notes));
  }
  for (const Candidate& candidate : candidates) {
    const DicomHeader& first = candidate.group.slices.front();
    const DicomHeader& taken = chosen.group.slices.front();
    if (first.file_number != taken.file_number || first.frame != taken.frame) {
      aside.push_back(candidate.group);
    }
  }
  stack.slices = chosen.scans.front().slices;
  TF_RETURN_IF_ERROR(CheckKinds(stack.slices));
  AddNotes(chosen, aside, &stack);
  return stack;
}

}  // namespace tissueform
