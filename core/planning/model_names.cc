// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/model_names.h"

#include <array>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace tissueform {
namespace {

// A word of the plan format.
template <typename Value>
struct Word {
  absl::string_view name;
  Value value;
};

constexpr std::array<Word<RotationMode>, 3> kRotations = {{
    {"propagated", RotationMode::kPropagated},
    {"estimated", RotationMode::kEstimated},
    {"none", RotationMode::kNone},
}};
constexpr std::array<Word<Guidance>, 2> kGuidances = {{
    {"cotangent", Guidance::kCotangent},
    {"uniform", Guidance::kUniform},
}};
// BlendMap::kUnblended has no word: it is there for the experiments only.
constexpr std::array<Word<BlendMap>, 2> kBlends = {{
    {"cosine", BlendMap::kCosine},
    {"linear", BlendMap::kLinear},
}};

template <typename Words>
std::string Names(const Words& words) {
  std::vector<std::string> names;
  names.reserve(words.size());
  for (const auto& word : words) names.push_back(absl::StrCat("\"", word.name, "\""));
  return absl::StrJoin(names, " or ");
}

template <typename Words>
absl::Status UnknownName(const Words& words, absl::string_view name, absl::string_view key) {
  return absl::InvalidArgumentError(
      absl::StrCat("there is no ", key, " \"", name, "\"; use ", Names(words)));
}

template <typename Value, size_t N>
absl::StatusOr<Value> Find(const std::array<Word<Value>, N>& words, absl::string_view name,
                           absl::string_view key) {
  for (const Word<Value>& word : words) {
    if (word.name == name) return word.value;
  }
  return UnknownName(words, name, key);
}

template <typename Value, size_t N>
std::string NameOf(const std::array<Word<Value>, N>& words, Value value) {
  for (const Word<Value>& word : words) {
    if (word.value == value) return std::string(word.name);
  }
  return "unknown";
}

}  // namespace

std::vector<std::string> KnownModelNames() {
  std::vector<std::string> names;
  for (const ModelTraits& traits : AllModels()) names.emplace_back(traits.name);
  return names;
}

absl::StatusOr<DeformationModel> ModelFromName(absl::string_view name) {
  for (const ModelTraits& traits : AllModels()) {
    if (traits.name == name) return traits.model;
  }
  return UnknownName(AllModels(), name, "model");
}

std::string ModelName(DeformationModel model) { return std::string(TraitsOf(model).name); }

absl::StatusOr<RotationMode> RotationModeFromName(absl::string_view name) {
  return Find(kRotations, name, "gradient_field.rotation");
}

std::string RotationModeName(RotationMode mode) { return NameOf(kRotations, mode); }

absl::StatusOr<Guidance> GuidanceFromName(absl::string_view name) {
  return Find(kGuidances, name, "gradient_field.guidance");
}

absl::StatusOr<BlendMap> BlendFromName(absl::string_view name) {
  return Find(kBlends, name, "gradient_field.blend");
}

}  // namespace tissueform
