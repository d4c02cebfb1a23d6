// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/objects/prediction_input.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "core/base/status_macros.h"
#include "proto/conversion/geometry_conversion.h"

namespace tissueform {
namespace {

absl::Status CheckUid(const std::string& what, const std::string& uid) {
  if (IsDicomUid(uid)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(what, " is not a UID; use NewDicomUid"));
}

absl::Status CheckUids(const PredictionObjectsInput& input) {
  std::set<std::string> seen;
  for (const std::string& key : PredictionUidKeys(input.contents)) {
    const auto found = input.uids.find(key);
    TF_RETURN_IF_ERROR(CheckUid(absl::StrCat("the UID of \"", key, "\""),
                                found == input.uids.end() ? "" : found->second));
    if (!seen.insert(found->second).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("the UID of \"", key, "\" belongs to another object; make one for each"));
    }
  }
  TF_RETURN_IF_ERROR(CheckUid("the UID of the source series", input.source_series_uid));
  for (const SourceImage& image : input.source_images) {
    TF_RETURN_IF_ERROR(CheckUid("the class of a source image", image.class_uid));
    TF_RETURN_IF_ERROR(CheckUid("the UID of a source image", image.instance_uid));
  }
  return absl::OkStatus();
}

bool IsNumber(const v1::Measure& measure) {
  return std::isfinite(measure.before()) && std::isfinite(measure.after()) &&
         std::isfinite(measure.lowest_after()) && std::isfinite(measure.highest_after());
}

absl::Status CheckMeasures(const std::vector<v1::Measure>& measures) {
  if (measures.size() > kMaxReportedMeasures) {
    return absl::InvalidArgumentError(absl::StrCat(measures.size(), " measures are more than the ",
                                                   kMaxReportedMeasures, " allowed"));
  }
  for (const v1::Measure& measure : measures) {
    if (IsNumber(measure) && (measure.unit() == "mm" || measure.unit() == "deg")) continue;
    return absl::InvalidArgumentError(
        "a measure has an invalid number, or a unit other than mm and deg");
  }
  return absl::OkStatus();
}

bool HasSurface(const CaseFile& contents, const std::string& handle) {
  return std::any_of(contents.surfaces.begin(), contents.surfaces.end(),
                     [&](const CaseSurface& surface) {
                       return surface.kind != SurfaceKind::kSkin && surface.handle == handle;
                     });
}

}  // namespace

std::vector<std::string> ObjectKeys(const CaseFile& contents) {
  std::vector<std::string> keys = {"stl:skin", "stl:skin-before"};
  for (const CaseHandle& handle : contents.handles) {
    if (HasSurface(contents, handle.name)) keys.push_back("stl:segment:" + handle.name);
  }
  if (HasSurface(contents, "")) keys.emplace_back("stl:bone");
  keys.emplace_back("capture");
  keys.emplace_back("report");
  return keys;
}

std::vector<std::string> PredictionUidKeys(const CaseFile& contents) {
  std::vector<std::string> keys = ObjectKeys(contents);
  for (const char* key : {"series:models", "series:capture", "series:report", "group"}) {
    keys.emplace_back(key);
  }
  return keys;
}

std::string SeriesKeyOf(const std::string& object_key) {
  return absl::StartsWith(object_key, "stl:") ? "series:models" : "series:" + object_key;
}

absl::Status CheckPredictionInput(const PredictionObjectsInput& input) {
  if (input.source_images.empty() || input.source_images.size() > kMaxSourceImages) {
    return absl::InvalidArgumentError(
        absl::StrCat("the case has ", input.source_images.size(), " source images; 1 to ",
                     kMaxSourceImages, " are allowed; name the images that it was built from"));
  }
  if (input.pictures.empty() || input.pictures.size() > kMaxPictures) {
    return absl::InvalidArgumentError(
        absl::StrCat("there are ", input.pictures.size(), " pictures; 1 to ", kMaxPictures,
                     " are allowed; `tissueform case render` makes them"));
  }
  const auto is_distance = [](double mm) { return std::isfinite(mm) && mm >= 0; };
  const auto vertices = static_cast<size_t>(input.contents.mesh.vertex_count);
  if (!input.band_mm.empty() &&
      (input.band_mm.size() != vertices ||
       !std::all_of(input.band_mm.begin(), input.band_mm.end(), is_distance))) {
    return absl::InvalidArgumentError(
        "the band of uncertainty needs one distance for each vertex of the case's mesh");
  }
  if (input.device_serial.empty()) {
    return absl::InvalidArgumentError("the bridge has no serial number");
  }
  TF_RETURN_IF_ERROR(CheckMeasures(input.measures));
  return CheckUids(input);
}

std::map<std::string, HandlePose> PosesOf(const v1::Prediction& prediction) {
  std::map<std::string, HandlePose> poses;
  for (const v1::HandlePose& pose : prediction.poses()) {
    poses[pose.handle()] = ToNamedPose(pose).pose;
  }
  return poses;
}

}  // namespace tissueform
