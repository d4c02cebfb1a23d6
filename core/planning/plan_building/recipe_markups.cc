// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/recipe_markups.h"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "core/planning/json_values.h"
#include "core/planning/plan_building/given_landmarks.h"
#include "core/planning/plan_building/markups_file.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

class MarkupsInserter {
 public:
  MarkupsInserter(const std::optional<std::string>& folder, Json* recipe)
      : folder_(folder), recipe_(*recipe) {}

  absl::Status Insert() {
    TF_RETURN_IF_ERROR(InsertPlane(&recipe_, "occlusal_plane", "", {0, 0, 1}));
    if (recipe_.contains("region_of_interest")) {
      Json& region = recipe_["region_of_interest"];
      TF_RETURN_IF_ERROR(InsertPlane(&region, "back", "/region_of_interest", {0, -1, 0}));
      TF_RETURN_IF_ERROR(InsertPlane(&region, "above", "/region_of_interest", {0, 0, -1}));
      TF_RETURN_IF_ERROR(InsertPlane(&region, "below", "/region_of_interest", {0, 0, 1}));
    }
    if (recipe_.contains("head_frame")) {
      Json& frame = recipe_["head_frame"];
      TF_RETURN_IF_ERROR(InsertPlane(&frame, "midsagittal", "/head_frame", {1, 0, 0}));
      TF_RETURN_IF_ERROR(InsertPlane(&frame, "horizontal", "/head_frame", {0, 0, 1}));
    }
    TF_RETURN_IF_ERROR(InsertSegmentPlanes());
    TF_RETURN_IF_ERROR(InsertMouthLine());
    return InsertLandmarks();
  }

 private:
  absl::StatusOr<std::vector<Markup>> Read(const Json& file, const std::string& where) const {
    if (!folder_) {
      return absl::InvalidArgumentError(
          absl::StrCat("a file is named at ", where, ", and this recipe has no folder"));
    }
    absl::StatusOr<std::vector<Markup>> markups =
        ReadMarkups((std::filesystem::path(*folder_) / file.get<std::string>()).string());
    if (markups.ok()) return markups;
    return absl::Status(markups.status().code(),
                        absl::StrCat("at ", where, ": ", markups.status().message()));
  }

  // `side`: where the normal must point to; zero where the file decides.
  absl::Status InsertPlane(Json* parent, const std::string& key, const std::string& where,
                           const Eigen::Vector3d& side) {
    if (!parent->contains(key)) return absl::OkStatus();
    return InsertNumbers(&parent->at(key), absl::StrCat(where, "/", key), side);
  }

  absl::Status InsertNumbers(Json* plane, const std::string& where, const Eigen::Vector3d& side) {
    const bool has_numbers = plane->contains("point_mm") && plane->contains("normal");
    if (!plane->contains("file")) {
      if (has_numbers && !plane->contains("name") && !plane->contains("flip")) {
        return absl::OkStatus();
      }
      return absl::InvalidArgumentError(
          absl::StrCat("the plane at ", where,
                       " needs \"point_mm\" and \"normal\", or the \"file\" of Slicer markups"));
    }
    if (plane->contains("point_mm") || plane->contains("normal")) {
      return absl::InvalidArgumentError(
          absl::StrCat("the plane at ", where, " has a \"file\" and numbers; give one"));
    }
    TF_ASSIGN_OR_RETURN(const std::vector<Markup> markups, Read(plane->at("file"), where));
    TF_ASSIGN_OR_RETURN(Plane found, ChoosePlane(markups, plane->value("name", ""), where));
    const bool wrong_side = found.normal.dot(side) < 0;
    if (wrong_side || (side.isZero() && plane->value("flip", false))) found.normal *= -1;
    *plane = {{"point_mm", ToJson(found.point_mm)}, {"normal", ToJson(found.normal)}};
    return absl::OkStatus();
  }

  static absl::StatusOr<Plane> ChoosePlane(const std::vector<Markup>& markups,
                                           const std::string& name, const std::string& where) {
    std::vector<Plane> planes;
    for (const Markup& markup : markups) {
      if (markup.plane && (name.empty() || markup.name == name)) planes.push_back(*markup.plane);
    }
    if (planes.size() == 1) return planes.front();
    if (planes.empty()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the markups file at ", where, " has no plane", name.empty() ? "" : " of that name",
          ": a plane, or three points that are not on one line"));
    }
    return absl::InvalidArgumentError(absl::StrCat("the markups file at ", where, " has ",
                                                   planes.size(),
                                                   " planes; choose one by its \"name\""));
  }

  absl::Status InsertSegmentPlanes() {
    Json& segments = recipe_.at("segments");
    for (size_t s = 0; s < segments.size(); ++s) {
      if (!segments[s].contains("planes")) continue;
      Json& planes = segments[s]["planes"];
      for (size_t p = 0; p < planes.size(); ++p) {
        TF_RETURN_IF_ERROR(InsertNumbers(&planes[p], absl::StrCat("/segments/", s, "/planes/", p),
                                         Eigen::Vector3d::Zero()));
      }
    }
    return absl::OkStatus();
  }

  absl::Status InsertMouthLine() {
    if (!recipe_.contains("lips") || !recipe_["lips"].contains("mouth_line_file")) {
      return absl::OkStatus();
    }
    Json& lips = recipe_["lips"];
    if (lips.contains("mouth_line_mm")) {
      return absl::InvalidArgumentError(
          "\"mouth_line_mm\" and \"mouth_line_file\" at /lips exclude each other; give one");
    }
    constexpr char kWhere[] = "/lips/mouth_line_file";
    TF_ASSIGN_OR_RETURN(const std::vector<Markup> markups,
                        Read(lips.at("mouth_line_file"), kWhere));
    std::vector<MarkupPoint> points = markups.front().points;
    if (markups.size() != 1 || points.size() < 3 || points.size() > 200) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the markups file at ", kWhere,
          " must hold one curve or point list of 3 to 200 points along the mouth line"));
    }
    if (points.front().position_mm.x() > points.back().position_mm.x()) {
      std::reverse(points.begin(), points.end());
    }
    lips.erase("mouth_line_file");
    for (const MarkupPoint& point : points) {
      lips["mouth_line_mm"].push_back(ToJson(point.position_mm));
    }
    return absl::OkStatus();
  }

  absl::Status InsertLandmarks() {
    if (!recipe_.contains("landmarks") || !recipe_["landmarks"].contains("file")) {
      return absl::OkStatus();
    }
    Json& landmarks = recipe_["landmarks"];
    constexpr char kWhere[] = "/landmarks/file";
    TF_ASSIGN_OR_RETURN(const std::vector<Markup> markups, Read(landmarks.at("file"), kWhere));
    landmarks.erase("file");
    Json& places = landmarks["points_mm"];
    if (places.is_null()) places = Json::object();
    for (const Markup& markup : markups) {
      for (const MarkupPoint& point : markup.points) {
        const std::string name = LandmarkNameOf(point.label);
        if (name.empty()) continue;
        if (places.contains(name)) {
          return absl::InvalidArgumentError(
              absl::StrCat("the landmark \"", name, "\" is given twice (", kWhere, ")"));
        }
        places[name] = ToJson(point.position_mm);
      }
    }
    if (!places.empty()) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat("no point of the markups file at ", kWhere,
                     " has the name of a landmark; label the points: ", LandmarkNames()));
  }

  const std::optional<std::string>& folder_;
  Json& recipe_;
};

}  // namespace

absl::Status InsertMarkups(const std::optional<std::string>& folder, nlohmann::json* recipe) {
  return MarkupsInserter(folder, recipe).Insert();
}

}  // namespace tissueform
