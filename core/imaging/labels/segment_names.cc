// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/segment_names.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxNameBytes = 40;
constexpr size_t kMaxNamesInMessage = 6;

struct Convention {
  absl::string_view key;
  absl::string_view name;
  std::vector<Structure> structures;  // of values 1, 2, ..
};

const std::vector<Convention>& Conventions() {
  using enum Structure;
  static const auto* const conventions = new std::vector<Convention>{
      {"dentalsegmentator",
       "DentalSegmentator",
       {kSkull, kLowerJaw, kUpperTeeth, kLowerTeeth, kCanal}},
      {"totalsegmentator",
       "TotalSegmentator craniofacial_structures",
       {kLowerJaw, kLowerTeeth, kSkull, kHead, kSinus, kSinus, kUpperTeeth}},
      {"totalsegmentator_6",
       "TotalSegmentator craniofacial_structures with six labels",
       {kLowerJaw, kLowerTeeth, kSkull, kSinus, kSinus, kUpperTeeth}}};
  return *conventions;
}

// "3 (lower jaw)"; the name comes from outside.
std::string NameOf(const LabelSegment& segment) {
  if (segment.name.empty()) return absl::StrCat(segment.value);
  return absl::StrCat(segment.value, " (", segment.name, ")");
}

bool SameName(absl::string_view a, absl::string_view b) {
  return absl::AsciiStrToLower(absl::StripAsciiWhitespace(a)) ==
         absl::AsciiStrToLower(absl::StripAsciiWhitespace(b));
}

// A rule that meets nothing is a slip: the plan would silently lack what the user has stated.
absl::Status ApplyRules(const std::vector<LabelRule>& rules, const std::vector<SegmentFacts>& facts,
                        std::vector<LabelSegment>* segments) {
  for (const LabelRule& rule : rules) {
    bool met = false;
    for (size_t s = 0; s < segments->size(); ++s) {
      LabelSegment& segment = (*segments)[s];
      const bool fits =
          rule.value ? segment.value == *rule.value : SameName(facts[s].name, rule.name);
      if (!fits) continue;
      segment.structure = rule.structure;
      met = true;
    }
    if (met) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        "\"names\" of the recipe has ",
        rule.value ? absl::StrCat("the value ", *rule.value)
                   : absl::StrCat("the name \"", PrintableName(rule.name), "\""),
        " for ", StructureKey(rule.structure), ", but the file has no such segment; correct it"));
  }
  return absl::OkStatus();
}

std::optional<NamedStructure> StructureOfFacts(const SegmentFacts& facts) {
  if (const auto named = StructureOfName(facts.name)) return named;
  for (const SegmentFacts::Code& code : facts.codes) {
    if (const auto known = StructureOfCode(code.scheme, code.value)) return {{*known}};
    if (const auto named = StructureOfName(code.meaning)) return named;
  }
  return std::nullopt;
}

void ApplyFacts(const std::vector<SegmentFacts>& facts, std::vector<LabelSegment>* segments) {
  for (size_t s = 0; s < segments->size(); ++s) {
    LabelSegment& segment = (*segments)[s];
    const std::optional<NamedStructure> named = StructureOfFacts(facts[s]);
    if (named) segment.side = named->side;
    if (named && !segment.structure) segment.structure = named->structure;
  }
}

// Volume and mean height of what a convention makes of the numbers.
struct Body {
  double mm3 = 0;
  double z_mm = 0;
};

std::map<Structure, Body> BodiesOf(const Convention& convention,
                                   const std::vector<LabelSegment>& segments, double voxel_mm3) {
  std::map<Structure, Body> bodies;
  for (const LabelSegment& segment : segments) {
    const auto index = static_cast<size_t>(segment.value - 1);
    Body& body = bodies[convention.structures[index]];
    const double mm3 = static_cast<double>(segment.voxels) * voxel_mm3;
    body.z_mm = (body.z_mm * body.mm3 + segment.middle_mm.z() * mm3) / (body.mm3 + mm3);
    body.mm3 += mm3;
  }
  return bodies;
}

// Whether the numbers can be those of a convention: by what is larger and higher in every head.
bool Fits(const Convention& convention, const std::vector<LabelSegment>& segments,
          double voxel_mm3) {
  const auto most = static_cast<int>(convention.structures.size());
  for (const LabelSegment& segment : segments) {
    if (segment.value > most) return false;
  }
  const std::map<Structure, Body> bodies = BodiesOf(convention, segments, voxel_mm3);
  const auto both = [&](Structure a, Structure b, const auto& holds) {
    return !bodies.contains(a) || !bodies.contains(b) || holds(bodies.at(a), bodies.at(b));
  };
  const auto larger = [](const Body& a, const Body& b) { return a.mm3 > b.mm3; };
  const auto higher = [](const Body& a, const Body& b) { return a.z_mm > b.z_mm; };
  using enum Structure;
  return bodies.contains(kLowerJaw) && bodies.contains(kSkull) && both(kSkull, kLowerJaw, larger) &&
         both(kSkull, kLowerJaw, higher) && both(kLowerJaw, kLowerTeeth, larger) &&
         both(kSkull, kUpperTeeth, larger) && both(kUpperTeeth, kLowerTeeth, higher) &&
         both(kLowerJaw, kCanal, larger) && both(kSkull, kSinus, larger) &&
         both(kHead, kSkull, larger);
}

void ApplyConvention(const Convention& convention, std::vector<LabelSegment>* segments) {
  for (LabelSegment& segment : *segments) {
    const auto index = static_cast<size_t>(segment.value - 1);
    if (segment.structure || index >= convention.structures.size()) continue;
    segment.structure = convention.structures[index];
  }
}

absl::Status ApplyNumbers(const std::string& stated, double voxel_mm3,
                          std::vector<LabelSegment>* segments, std::vector<std::string>* notes) {
  std::vector<const Convention*> fitting;
  for (const Convention& convention : Conventions()) {
    if (convention.key == stated) {
      ApplyConvention(convention, segments);
      return absl::OkStatus();
    }
    if (Fits(convention, *segments, voxel_mm3)) fitting.push_back(&convention);
  }
  if (fitting.size() != 1) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the file has no names for its labels, and their numbers fit ",
        fitting.empty() ? "no known convention" : "more than one convention",
        "; state \"convention\" (dentalsegmentator, totalsegmentator, totalsegmentator_6) or "
        "\"names\" at \"labels\" in the recipe"));
  }
  notes->push_back(absl::StrCat(
      "The label map has no names: its numbers are read as those of ", fitting.front()->name,
      ", the only known convention that sizes and places of the labels fit."));
  ApplyConvention(*fitting.front(), segments);
  return absl::OkStatus();
}

// The patient's left has the larger x in LPS. Names without their own structure count as well.
absl::Status CheckSides(const std::vector<LabelSegment>& segments) {
  for (const LabelSegment& left : segments) {
    for (const LabelSegment& right : segments) {
      if (left.side != Side::kLeft || right.side != Side::kRight ||
          left.structure != right.structure)
        continue;
      if (left.middle_mm.x() > right.middle_mm.x()) continue;
      return absl::InvalidArgumentError(absl::StrFormat(
          "left and right are swapped: label %s lies %.0f mm to the right of label %s; the map is "
          "mirrored, or its names are wrong: export it again",
          NameOf(left), right.middle_mm.x() - left.middle_mm.x(), NameOf(right)));
    }
  }
  return absl::OkStatus();
}

void NoteIgnored(const std::vector<LabelSegment>& segments, std::vector<std::string>* notes) {
  std::vector<const LabelSegment*> ignored;
  for (const LabelSegment& segment : segments) {
    if (!segment.structure) ignored.push_back(&segment);
  }
  if (ignored.empty()) return;
  notes->push_back(absl::StrCat(
      "The label map has segments that are not known and not used: ", NamesOf(ignored), "."));
}

absl::Status CheckKnown(const std::vector<LabelSegment>& segments) {
  std::vector<const LabelSegment*> all;
  for (const LabelSegment& segment : segments) {
    if (segment.structure) return absl::OkStatus();
    all.push_back(&segment);
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "none of its ", segments.size(), " segments is known: ", NamesOf(all),
      "; state what they are at \"labels/names\" in the recipe (", StructureKeys(), ")"));
}

}  // namespace

bool IsKnownName(const LabelReadOptions& options, absl::string_view name) {
  return StructureOfName(name).has_value() ||
         std::ranges::any_of(options.names,
                             [&](const LabelRule& rule) { return SameName(rule.name, name); });
}

std::string NamesOf(const std::vector<const LabelSegment*>& segments) {
  std::vector<std::string> names;
  for (const LabelSegment* segment : segments) {
    if (names.size() == kMaxNamesInMessage) break;
    names.push_back(NameOf(*segment));
  }
  std::string text = absl::StrJoin(names, ", ");
  if (segments.size() > names.size()) {
    absl::StrAppend(&text, " and ", segments.size() - names.size(), " more");
  }
  return text;
}

std::string PrintableName(absl::string_view name) {
  std::string printable;
  for (const char letter : absl::StripAsciiWhitespace(name)) {
    if (printable.size() == kMaxNameBytes) break;
    const bool is_plain = absl::ascii_isprint(static_cast<unsigned char>(letter)) && letter != '"';
    printable.push_back(is_plain ? letter : '?');
  }
  return printable;
}

absl::Status AssignStructures(const LabelReadOptions& options,
                              const std::vector<SegmentFacts>& facts, double voxel_mm3,
                              std::vector<LabelSegment>* segments,
                              std::vector<std::string>* notes) {
  if (segments->empty()) {
    return absl::InvalidArgumentError("no voxel of it is labelled; export the segmentation again");
  }
  TF_RETURN_IF_ERROR(ApplyRules(options.names, facts, segments));
  ApplyFacts(facts, segments);
  const bool has_names =
      std::ranges::any_of(facts, [](const SegmentFacts& f) { return !f.name.empty(); });
  const bool none_known = std::ranges::none_of(
      *segments, [](const LabelSegment& s) { return s.structure.has_value(); });
  if (!options.convention.empty() || (!has_names && none_known)) {
    TF_RETURN_IF_ERROR(ApplyNumbers(options.convention, voxel_mm3, segments, notes));
  }
  TF_RETURN_IF_ERROR(CheckKnown(*segments));
  NoteIgnored(*segments, notes);
  return CheckSides(*segments);
}

}  // namespace tissueform
