// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/structures.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace tissueform {
namespace {

constexpr std::array<absl::string_view, kNumStructures> kKeys = {
    "mandible", "skull",  "upper_teeth", "lower_teeth", "canal",  "sinus",
    "head",     "airway", "tube",        "spine",       "muscle", "fat"};

using Name = std::pair<absl::string_view, Structure>;

// Names without words for a side, in lower case, with single spaces between words.
constexpr std::array kNames = {
    // DentalSegmentator.
    Name("maxilla and upper skull", Structure::kSkull),
    Name("maxilla upper skull", Structure::kSkull),
    Name("mandible", Structure::kLowerJaw),
    Name("upper teeth", Structure::kUpperTeeth),
    Name("lower teeth", Structure::kLowerTeeth),
    Name("mandibular canal", Structure::kCanal),
    // TotalSegmentator, craniofacial_structures and the tasks beside it.
    Name("teeth lower", Structure::kLowerTeeth),
    Name("teeth upper", Structure::kUpperTeeth),
    Name("skull", Structure::kSkull),
    Name("head", Structure::kHead),
    Name("sinus maxillary", Structure::kSinus),
    Name("sinus frontal", Structure::kSinus),
    // Other names that segmentation programs and Slicer users give.
    Name("lower jaw", Structure::kLowerJaw),
    Name("lower jawbone", Structure::kLowerJaw),
    Name("mandible bone", Structure::kLowerJaw),
    Name("mandibular bone", Structure::kLowerJaw),
    Name("upper skull", Structure::kSkull),
    Name("cranium", Structure::kSkull),
    Name("maxilla", Structure::kSkull),
    Name("upper jaw", Structure::kSkull),
    Name("upper jawbone", Structure::kSkull),
    Name("maxillary bone", Structure::kSkull),
    Name("maxillary teeth", Structure::kUpperTeeth),
    Name("mandibular teeth", Structure::kLowerTeeth),
    Name("inferior alveolar canal", Structure::kCanal),
    Name("mandible canal", Structure::kCanal),
    Name("inferior alveolar nerve", Structure::kCanal),
    Name("canal", Structure::kCanal),
    Name("maxillary sinus", Structure::kSinus),
    Name("frontal sinus", Structure::kSinus),
    Name("sphenoid sinus", Structure::kSinus),
    Name("ethmoid sinus", Structure::kSinus),
    Name("sinus", Structure::kSinus),
    Name("sinuses", Structure::kSinus),
    Name("skin", Structure::kHead),
    Name("airway", Structure::kAirway),
    Name("upper airway", Structure::kAirway),
    Name("pharynx", Structure::kAirway),
    Name("nasal cavity", Structure::kAirway),
    Name("trachea", Structure::kAirway),
    Name("tube", Structure::kTube),
    Name("endotracheal tube", Structure::kTube),
    Name("breathing tube", Structure::kTube),
    Name("spine", Structure::kNeckBones),
    Name("cervical spine", Structure::kNeckBones),
    Name("vertebrae", Structure::kNeckBones),
    Name("hyoid", Structure::kNeckBones),
    Name("hyoid bone", Structure::kNeckBones),
    Name("muscle", Structure::kMuscle),
    Name("muscles", Structure::kMuscle),
    Name("skeletal muscle", Structure::kMuscle),
    Name("masseter", Structure::kMuscle),
    Name("fat", Structure::kFat),
    Name("subcutaneous fat", Structure::kFat),
    Name("torso fat", Structure::kFat),
    Name("adipose tissue", Structure::kFat),
    Name("vertebrae c1", Structure::kNeckBones),
    Name("vertebrae c2", Structure::kNeckBones),
    Name("vertebrae c3", Structure::kNeckBones),
    Name("vertebrae c4", Structure::kNeckBones),
    Name("vertebrae c5", Structure::kNeckBones),
    Name("vertebrae c6", Structure::kNeckBones),
    Name("vertebrae c7", Structure::kNeckBones),
};

using Code = std::pair<absl::string_view, Structure>;

constexpr std::array kSctCodes = {
    Code("91609006", Structure::kLowerJaw), Code("70925003", Structure::kSkull),
    Code("89546000", Structure::kSkull),    Code("39937001", Structure::kHead),
    Code("69536005", Structure::kHead),     Code("15924003", Structure::kSinus),
    Code("55060009", Structure::kSinus),    Code("89187006", Structure::kAirway),
};
constexpr std::array kSrtCodes = {
    Code("T-11180", Structure::kLowerJaw), Code("T-11170", Structure::kSkull),
    Code("T-11100", Structure::kSkull),    Code("T-01000", Structure::kHead),
    Code("T-D1100", Structure::kHead),     Code("T-22100", Structure::kSinus),
    Code("T-22200", Structure::kSinus),    Code("T-20001", Structure::kAirway),
};

template <typename Table>
std::optional<Structure> Find(const Table& table, absl::string_view name) {
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const auto& row) { return row.first == name; });
  if (found == table.end()) return std::nullopt;
  return found->second;
}

std::vector<std::string> WordsOf(absl::string_view name) {
  std::string lower;
  for (const char letter : name) {
    const auto byte = static_cast<unsigned char>(letter);
    lower.push_back(absl::ascii_isalnum(byte) ? absl::ascii_tolower(byte) : ' ');
  }
  return absl::StrSplit(lower, ' ', absl::SkipEmpty());
}

}  // namespace

absl::string_view StructureKey(Structure structure) {
  return kKeys[static_cast<size_t>(structure)];
}

std::optional<Structure> StructureOfKey(absl::string_view key) {
  for (size_t i = 0; i < kKeys.size(); ++i) {
    if (kKeys[i] == key) return static_cast<Structure>(i);
  }
  return std::nullopt;
}

std::string StructureKeys() { return absl::StrJoin(kKeys, ", "); }

std::optional<NamedStructure> StructureOfName(absl::string_view name) {
  std::vector<std::string> words;
  Side side = Side::kNone;
  for (std::string& word : WordsOf(name.substr(0, 200))) {
    if (word == "left" || word == "l") {
      side = Side::kLeft;
    } else if (word == "right" || word == "r") {
      side = Side::kRight;
    } else {
      words.push_back(std::move(word));
    }
  }
  const std::optional<Structure> structure = Find(kNames, absl::StrJoin(words, " "));
  if (!structure) return std::nullopt;
  return NamedStructure{*structure, side};
}

std::optional<Structure> StructureOfCode(absl::string_view scheme, absl::string_view code) {
  if (scheme == "SCT") return Find(kSctCodes, code);
  if (scheme == "SRT") return Find(kSrtCodes, code);
  return std::nullopt;
}

}  // namespace tissueform
