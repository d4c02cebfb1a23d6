// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/given_landmarks.h"

#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace tissueform {
namespace {

// Found landmarks are good to a few mm; another person's clicks differ by as much.
constexpr double kFarthestMm = 20;

struct OnePlace {
  const char* name;
  const char* abbreviation;
  Eigen::Vector3d Landmarks::*place;
};
constexpr std::array<OnePlace, 9> kPlaces = {{
    {"upper_incisor", "u1", &Landmarks::upper_incisor},
    {"lower_incisor", "l1", &Landmarks::lower_incisor},
    {"pogonion", "pog", &Landmarks::pogonion},
    {"menton", "me", &Landmarks::menton},
    {"pronasale", "prn", &Landmarks::nose_tip},
    {"subnasale", "sn", &Landmarks::subnasale},
    {"labrale_superius", "ls", &Landmarks::upper_lip},
    {"labrale_inferius", "li", &Landmarks::lower_lip},
    {"soft_pogonion", "pog'", &Landmarks::skin_pogonion},
}};

struct TwoPlaces {
  const char* name;
  const char* abbreviation;
  LeftAndRight Landmarks::*places;
};
constexpr std::array<TwoPlaces, 4> kPairs = {{
    {"upper_molar", "u6", &Landmarks::upper_molar},
    {"lower_molar", "l6", &Landmarks::lower_molar},
    {"gonion", "go", &Landmarks::gonion},
    {"condyle", "co", &Landmarks::condyle},
}};

struct FrankfortPair {
  const char* name;
  const char* abbreviation;
  LeftAndRight FrankfortLandmarks::*places;
};
constexpr std::array<FrankfortPair, 2> kFrankfortPairs = {{
    {"porion", "po", &FrankfortLandmarks::porion},
    {"orbitale", "or", &FrankfortLandmarks::orbitale},
}};

struct Side {
  const char* name;
  const char* abbreviation;
  Eigen::Vector3d LeftAndRight::*place;
};
constexpr std::array<Side, 2> kSides = {
    {{"_left", "_l", &LeftAndRight::left}, {"_right", "_r", &LeftAndRight::right}}};

// What a label may say of each landmark, by its name.
std::map<std::string, std::vector<std::string>> LabelsByName() {
  std::map<std::string, std::vector<std::string>> labels;
  for (const OnePlace& one : kPlaces) labels[one.name] = {one.name, one.abbreviation};
  labels["pogonion"].emplace_back("pg");
  const auto add_pair = [&labels](const std::string& name, const std::string& abbreviation) {
    for (const Side& side : kSides) {
      std::vector<std::string>& of_side = labels[name + side.name];
      for (const std::string& start : {name, abbreviation}) {
        of_side.push_back(start + side.name);
        of_side.push_back(start + side.abbreviation);
      }
    }
  };
  for (const TwoPlaces& pair : kPairs) add_pair(pair.name, pair.abbreviation);
  for (const FrankfortPair& pair : kFrankfortPairs) add_pair(pair.name, pair.abbreviation);
  return labels;
}

absl::Status CheckNear(const std::string& name, const Eigen::Vector3d& given,
                       const Eigen::Vector3d& found) {
  const double far_mm = (given - found).norm();
  if (far_mm <= kFarthestMm) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "the landmark \"%s\" is given %.0f mm from where the CT shows it; is it of this patient, in "
      "mm, and in the axes that its file states (\"points_mm\": LPS)?",
      name, far_mm));
}

// Takes places by their names out of the given ones.
class LandmarkPlacer {
 public:
  LandmarkPlacer(const GivenLandmarks& given, Landmarks* landmarks)
      : left_(given), landmarks_(*landmarks) {}

  absl::Status Place(const std::string& name, Eigen::Vector3d* place) {
    const auto found = left_.find(name);
    if (found == left_.end()) return absl::OkStatus();
    if (absl::Status near = CheckNear(name, found->second, *place); !near.ok()) return near;
    *place = found->second;
    left_.erase(found);
    return absl::OkStatus();
  }

  absl::Status PlaceAll() {
    absl::Status status;
    for (const OnePlace& one : kPlaces) status.Update(Place(one.name, &(landmarks_.*one.place)));
    for (const TwoPlaces& pair : kPairs)
      status.Update(PlacePair(pair.name, &(landmarks_.*pair.places)));
    landmarks_.SetTeethPlanes();
    return status;
  }

  absl::Status PlaceFrankfort(std::optional<FrankfortLandmarks>* frankfort) {
    FrankfortLandmarks places = frankfort->value_or(FrankfortLandmarks{});
    size_t given = 0;
    for (const FrankfortPair& pair : kFrankfortPairs) {
      for (const Side& side : kSides) {
        const auto found = left_.find(absl::StrCat(pair.name, side.name));
        if (found == left_.end()) continue;
        ++given;
        if (!frankfort->has_value()) places.*pair.places.*side.place = found->second;
      }
    }
    if (given == 0) return absl::OkStatus();
    if (!frankfort->has_value() && given < 4) {
      return absl::InvalidArgumentError(
          "porions and orbitalia were not found in the CT; give all four landmarks (porion_left, "
          "porion_right, orbitale_left, orbitale_right) or none");
    }
    absl::Status status;
    for (const FrankfortPair& pair : kFrankfortPairs) {
      status.Update(PlacePair(pair.name, &(places.*pair.places)));
    }
    *frankfort = places;
    return status;
  }

  absl::Status CheckAllPlaced() const {
    if (left_.empty()) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        "\"", left_.begin()->first, "\" is not the name of a landmark; use ", LandmarkNames()));
  }

 private:
  absl::Status PlacePair(const std::string& name, LeftAndRight* places) {
    absl::Status status;
    for (const Side& side : kSides) {
      status.Update(Place(name + side.name, &(places->*side.place)));
    }
    return status;
  }

  GivenLandmarks left_;
  Landmarks& landmarks_;
};

}  // namespace

std::string LandmarkNameOf(absl::string_view label) {
  const std::string plain = absl::StrReplaceAll(
      absl::AsciiStrToLower(absl::StripAsciiWhitespace(label)), {{" ", "_"}, {"-", "_"}});
  for (const auto& [name, labels] : LabelsByName()) {
    if (std::find(labels.begin(), labels.end(), plain) != labels.end()) return name;
  }
  return "";
}

std::string LandmarkNames() {
  return absl::StrJoin(LabelsByName(), ", ", [](std::string* out, const auto& entry) {
    absl::StrAppend(out, entry.first);
  });
}

absl::Status PlaceLandmarks(const GivenLandmarks& given, Landmarks* landmarks,
                            std::optional<FrankfortLandmarks>* frankfort,
                            std::vector<std::string>* notes) {
  if (given.empty()) return absl::OkStatus();
  LandmarkPlacer placer(given, landmarks);
  absl::Status status = placer.PlaceAll();
  status.Update(placer.PlaceFrankfort(frankfort));
  status.Update(placer.CheckAllPlaced());
  if (!status.ok()) return status;
  notes->push_back(absl::StrCat(
      "Landmarks from the recipe: ",
      absl::StrJoin(given, ", ",
                    [](std::string* out, const auto& entry) { absl::StrAppend(out, entry.first); }),
      "."));
  return absl::OkStatus();
}

}  // namespace tissueform
