// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/report_parts.h"

#include <array>
#include <iostream>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::string TypeName(const Attribute& attribute) {
  static constexpr std::array<const char*, std::variant_size_v<Attribute::Values>> kNames = {
      "int8",   "uint8", "int16",  "uint16",  "int32",
      "uint32", "int64", "uint64", "float32", "float64"};
  return kNames[attribute.values.index()];
}

const char* SeverityName(Severity severity) {
  return severity == Severity::kError ? "error" : "warning";
}

}  // namespace

std::string ArraysText(const std::vector<Attribute>& attributes) {
  if (attributes.empty()) return "none";
  return absl::StrJoin(attributes, ", ", [](std::string* out, const Attribute& a) {
    absl::StrAppend(out, a.name, " (", TypeName(a));
    if (a.components > 1) absl::StrAppend(out, " x ", a.components);
    out->append(")");
  });
}

OrderedJson ArraysJson(const std::vector<Attribute>& attributes) {
  OrderedJson json = OrderedJson::array();
  for (const Attribute& a : attributes) {
    json.push_back({{"name", a.name}, {"type", TypeName(a)}, {"components", a.components}});
  }
  return json;
}

std::string DefectsText(const std::vector<MeshDefect>& defects) {
  if (defects.empty()) return "  defects            none\n";
  std::string text;
  for (const MeshDefect& defect : defects) {
    absl::StrAppendFormat(&text, "  %-7s  %-22s %8d  %s\n", SeverityName(defect.severity),
                          std::string(defect.kind), defect.count, defect.explanation);
  }
  return text;
}

OrderedJson DefectsJson(const std::vector<MeshDefect>& defects) {
  OrderedJson json = OrderedJson::array();
  for (const MeshDefect& defect : defects) {
    json.push_back({{"kind", std::string(defect.kind)},
                    {"severity", SeverityName(defect.severity)},
                    {"count", defect.count},
                    {"examples", defect.examples},
                    {"explanation", defect.explanation}});
  }
  return json;
}

void PrintJsonReport(const OrderedJson& json) {
  std::cout << json.dump(2, ' ', false, OrderedJson::error_handler_t::replace) << '\n';
}

void PrintReport(bool as_json, const std::string& text, const OrderedJson& json) {
  if (as_json) {
    PrintJsonReport(json);
  } else {
    std::cout << text;
  }
}

}  // namespace tissueform
