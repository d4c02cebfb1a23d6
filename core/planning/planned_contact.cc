// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/planned_contact.h"

#include <algorithm>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/status_macros.h"
#include "core/planning/json_values.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

PlannedContactRow RowFromJson(const Json& json) {
  PlannedContactRow row;
  row.vertex = json.at("vertex").get<int64_t>();
  if (json.contains("handle")) row.other = json.at("handle").get<std::string>();
  if (json.contains("other_vertex")) row.other = json.at("other_vertex").get<int64_t>();
  row.normal = VectorFromJson(json.at("normal"));
  row.gap_mm = json.value("gap_mm", row.gap_mm);
  row.bilateral = json.value("bilateral", row.bilateral);
  return row;
}

Json RowToJson(const ContactRow& row, const std::vector<std::string>& handles,
               CoordinateSystem system) {
  Json json = {{"vertex", row.vertex}};
  if (row.other != ContactRow::kBone) {
    json["other_vertex"] = row.other;
  } else if (row.handle == ContactRow::kFixedBone) {
    json["fixed"] = true;
  } else {
    json["handle"] = handles[static_cast<size_t>(row.handle)];
  }
  json["normal"] = ToJson(Eigen::Vector3d(SignsToLps(system).cwiseProduct(row.normal)));
  if (row.gap_mm != 0) json["gap_mm"] = row.gap_mm;
  if (row.bilateral) json["bilateral"] = true;
  return json;
}

absl::StatusOr<int> HandleOf(const Plan& plan, size_t number, const std::string& name) {
  for (size_t h = 0; h < plan.handles.size(); ++h) {
    if (plan.handles[h].name == name) return static_cast<int>(h);
  }
  return absl::InvalidArgumentError(absl::StrCat("contact row ", number, " names handle \"", name,
                                                 "\"; the plan has no handle of that name"));
}

// Moves what `vertices` has in common with `touching` to `freed`.
absl::Status FreeVertices(const std::set<int32_t>& touching, int region, const std::string& name,
                          std::vector<int32_t>* vertices, std::vector<FreedVertex>* freed) {
  const bool had_vertices = !vertices->empty();
  std::erase_if(*vertices, [&](int32_t vertex) {
    if (!touching.contains(vertex)) return false;
    freed->push_back({vertex, region});
    return true;
  });
  if (!vertices->empty() || !had_vertices) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      name, ": every selected vertex has contact rows; select one more, or remove its rows"));
}

}  // namespace

std::vector<PlannedContactRow> ContactFromJson(const Json& contact) {
  std::vector<PlannedContactRow> rows;
  for (const Json& row : contact.at("rows")) rows.push_back(RowFromJson(row));
  return rows;
}

Json ContactToJson(const std::vector<ContactRow>& rows, const std::vector<std::string>& handles,
                   CoordinateSystem system) {
  Json json = {{"rows", Json::array()}};
  for (const ContactRow& row : rows) json["rows"].push_back(RowToJson(row, handles, system));
  return json;
}

absl::StatusOr<std::vector<ContactRow>> ResolveContact(const Plan& plan) {
  std::vector<ContactRow> rows;
  for (size_t number = 0; number < plan.contact.size(); ++number) {
    const PlannedContactRow& planned = plan.contact[number];
    ContactRow row{.vertex = static_cast<int32_t>(planned.vertex),
                   .normal = SignsToLps(plan.coordinate_system).cwiseProduct(planned.normal),
                   .gap_mm = planned.gap_mm,
                   .bilateral = planned.bilateral};
    if (const auto* name = std::get_if<std::string>(&planned.other)) {
      TF_ASSIGN_OR_RETURN(row.handle, HandleOf(plan, number, *name));
    } else if (const auto* other = std::get_if<int64_t>(&planned.other)) {
      row.other = static_cast<int32_t>(*other);
    }
    rows.push_back(row);
  }
  return rows;
}

LipEdge LipEdgeFromJson(const Json& seal) {
  LipEdge edge{.up = VectorFromJson(seal.at("up")), .pairs = {}};
  for (const Json& pair : seal.at("pairs")) {
    edge.pairs.push_back({.upper = pair[0].get<int32_t>(), .lower = pair[1].get<int32_t>()});
  }
  return edge;
}

Json LipEdgeToJson(const LipEdge& edge, CoordinateSystem system) {
  Json json = {{"up", ToJson(Eigen::Vector3d(SignsToLps(system).cwiseProduct(edge.up)))},
               {"pairs", Json::array()}};
  for (const LipEdge::Pair& pair : edge.pairs) {
    json["pairs"].push_back(Json::array({pair.upper, pair.lower}));
  }
  return json;
}

absl::StatusOr<std::optional<LipEdge>> ResolveLipEdge(const Plan& plan, const Positions& rest,
                                                      const std::vector<ContactRow>& rows) {
  if (!plan.lip_edge) return std::nullopt;
  LipEdge edge = *plan.lip_edge;
  edge.up = SignsToLps(plan.coordinate_system).cwiseProduct(edge.up);
  TF_RETURN_IF_ERROR(CheckLipEdge(edge, rest, rows));
  return edge;
}

absl::StatusOr<std::vector<FreedVertex>> FreeTouchingVertices(const std::vector<ContactRow>& rows,
                                                              std::vector<int32_t>* fixed,
                                                              std::vector<HandleRegion>* handles) {
  std::set<int32_t> touching;
  for (const ContactRow& row : rows) {
    touching.insert(row.vertex);
    if (row.other != ContactRow::kBone) touching.insert(row.other);
  }
  std::vector<FreedVertex> freed;
  TF_RETURN_IF_ERROR(FreeVertices(touching, ConstraintSet::kFixed, "fixed", fixed, &freed));
  for (size_t h = 0; h < handles->size(); ++h) {
    HandleRegion& handle = (*handles)[h];
    TF_RETURN_IF_ERROR(FreeVertices(touching, static_cast<int>(h),
                                    absl::StrCat("handle \"", handle.name, "\""), &handle.vertices,
                                    &freed));
  }
  std::ranges::sort(freed, {}, &FreedVertex::vertex);
  return freed;
}

}  // namespace tissueform
