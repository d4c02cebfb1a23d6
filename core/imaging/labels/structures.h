// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/strings/string_view.h"

namespace tissueform {

// What a label map can name. A voxel of a map holds a set of them, because segments may overlap.
enum class Structure : uint8_t {
  kLowerJaw,
  kSkull,  // with the upper jaw
  kUpperTeeth,
  kLowerTeeth,
  kCanal,  // of the lower jaw
  kSinus,
  kHead,  // or its skin; may leave out what other labels have
  kAirway,
  kTube,
  kNeckBones,  // with the hyoid bone
  kMuscle,
  kFat,
};
inline constexpr int kNumStructures = 12;

// Sets of structures, a bit each.
using StructureSet = uint16_t;
inline constexpr StructureSet SetOf(Structure structure) {
  return static_cast<StructureSet>(1U << static_cast<unsigned>(structure));
}
inline constexpr StructureSet kLowerJawSet =
    SetOf(Structure::kLowerJaw) | SetOf(Structure::kLowerTeeth) | SetOf(Structure::kCanal);
inline constexpr StructureSet kUpperJawSet =
    SetOf(Structure::kSkull) | SetOf(Structure::kUpperTeeth);
inline constexpr StructureSet kBoneSet = kLowerJawSet | kUpperJawSet | SetOf(Structure::kNeckBones);
inline constexpr StructureSet kHollowSet =
    SetOf(Structure::kSinus) | SetOf(Structure::kAirway) | SetOf(Structure::kTube);

// The key of a structure under "labels/names" of a recipe: "mandible", "upper_teeth", ...
absl::string_view StructureKey(Structure structure);
std::optional<Structure> StructureOfKey(absl::string_view key);

// All keys with commas between them, for messages.
std::string StructureKeys();

enum class Side { kNone, kLeft, kRight };

struct NamedStructure {
  Structure structure = Structure::kLowerJaw;
  Side side = Side::kNone;  // of the patient
};

// What the name of a segment means in the conventions that docs/ct-input.md lists. Case, word
// separators, and words for a side do not matter. Returns nothing for an unknown name.
std::optional<NamedStructure> StructureOfName(absl::string_view name);

// What a code of SNOMED CT or of its predecessor SRT means.
std::optional<Structure> StructureOfCode(absl::string_view scheme, absl::string_view code);

}  // namespace tissueform
