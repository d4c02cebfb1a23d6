// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/objects_report.h"

#include <algorithm>

#include "absl/strings/str_format.h"

#include "core/imaging/anatomy/plane.h"
#include "core/planning/json_values.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

// Faces of voxels on a smooth surface that may lie any way have 1.5 times its area on average.
constexpr double kFacesOfSurface = 1.5;

// Where a thing lay on the skin of the region of interest.
struct Contact {
  double area_mm2 = 0;
  Vector3d middle = Vector3d::Zero();
  Vector3d low = Vector3d::Zero();
  Vector3d high = Vector3d::Zero();
};

Contact ContactOf(const AttachedObject& object, const RegionOfInterest& region) {
  const std::vector<Plane> planes = region.planes();
  Contact contact;
  int64_t faces = 0;
  for (const Vector3d& place : object.contact_mm) {
    if (LeastHeightMm(planes, place) < 0) continue;
    contact.low = faces == 0 ? place : Vector3d(contact.low.cwiseMin(place));
    contact.high = faces == 0 ? place : Vector3d(contact.high.cwiseMax(place));
    contact.middle += place;
    ++faces;
  }
  if (faces == 0) return contact;
  contact.middle /= static_cast<double>(faces);
  contact.area_mm2 = static_cast<double>(faces) * object.face_mm2 / kFacesOfSurface;
  return contact;
}

const char* KindText(ObjectKind kind) {
  switch (kind) {
    case ObjectKind::kTube:
      return "A tube";
    case ObjectKind::kCord:
      return "A cord";
    case ObjectKind::kUnknown:
      break;
  }
  return "An object that is larger than an ear, and may contain a part of the face,";
}

const char* KindKey(ObjectKind kind) {
  switch (kind) {
    case ObjectKind::kTube:
      return "tube";
    case ObjectKind::kCord:
      return "cord";
    case ObjectKind::kUnknown:
      break;
  }
  return "unknown";
}

// One line for all objects of a kind on the skin, with the one that covers most; empty without any.
std::string CautionOf(const PlanBuild& build, ObjectKind kind) {
  const AttachedObject* largest = nullptr;
  Contact under_largest;
  int count = 0;
  double all_mm2 = 0;
  for (const AttachedObject& object : build.head.objects) {
    const Contact contact = ContactOf(object, build.soft_tissue.region);
    if (object.kind != kind || contact.area_mm2 == 0) continue;
    ++count;
    all_mm2 += contact.area_mm2;
    if (largest != nullptr && contact.area_mm2 <= under_largest.area_mm2) continue;
    largest = &object;
    under_largest = contact;
  }
  if (largest == nullptr) return "";
  const std::string others =
      count > 1 ? absl::StrFormat(" So were %d more of this kind; all cover %.1f cm2.", count - 1,
                                  all_mm2 / 100)
                : "";
  return absl::StrFormat(
      "%s on the skin was removed (%.1f cm3). The skin under it, about %.1f cm2 "
      "between (%.0f, %.0f, %.0f) and (%.0f, %.0f, %.0f) mm, is not visible in this CT, and its "
      "boundary there is estimated.%s",
      KindText(kind), largest->volume_mm3 / 1e3, under_largest.area_mm2 / 100,
      under_largest.low.x(), under_largest.low.y(), under_largest.low.z(), under_largest.high.x(),
      under_largest.high.y(), under_largest.high.z(), others);
}

}  // namespace

QualityCheck CheckObjects(const PlanBuild& build) {
  double largest_mm2 = 0;
  Vector3d place = Vector3d::Zero();
  for (const AttachedObject& object : build.head.objects) {
    const Contact contact = ContactOf(object, build.soft_tissue.region);
    if (object.kind != ObjectKind::kUnknown || contact.area_mm2 <= largest_mm2) continue;
    largest_mm2 = contact.area_mm2;
    place = contact.middle;
  }
  return {"Objects removed from the skin that may be face",
          absl::StrFormat("none in contact with more than %.1f cm2", kLargestHoleMm2 / 100),
          largest_mm2 == 0
              ? "none"
              : absl::StrFormat("one in contact with %.1f cm2 at (%.0f, %.0f, %.0f) mm",
                                largest_mm2 / 100, place.x(), place.y(), place.z()),
          largest_mm2 <= kLargestHoleMm2};
}

std::vector<std::string> ObjectsCautions(const PlanBuild& build) {
  std::vector<std::string> cautions;
  for (const ObjectKind kind : {ObjectKind::kTube, ObjectKind::kCord, ObjectKind::kUnknown}) {
    const std::string caution = CautionOf(build, kind);
    if (!caution.empty()) cautions.push_back(caution);
  }
  return cautions;
}

nlohmann::ordered_json ObjectsJson(const PlanBuild& build) {
  auto list = nlohmann::ordered_json::array();
  for (const AttachedObject& object : build.head.objects) {
    const Contact contact = ContactOf(object, build.soft_tissue.region);
    nlohmann::ordered_json row = {{"kind", KindKey(object.kind)},
                                  {"volume_mm3", object.volume_mm3},
                                  {"at_mm", ToJson(object.middle_mm)},
                                  {"skin_under_it_mm2", contact.area_mm2}};
    if (contact.area_mm2 > 0) row["skin_under_it_at_mm"] = ToJson(contact.middle);
    list.push_back(std::move(row));
  }
  return list;
}

}  // namespace tissueform
