// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/dicom_web_answers.h"

#include <cstdint>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

constexpr int kHttpOk = 200;
constexpr int kHttpAccepted = 202;

// Failure reasons of PS3.18 table I.2-2, which are those of C-STORE.
constexpr int kDuplicate = 0x0111;
constexpr int kOutOfResources = 0xA700;
constexpr int kReasonKind = 0xFF00;

int NumberIn(const Json& object, const char* tag) {
  const std::string text = JsonValueOf(object, tag);
  return text.empty() ? 0 : std::atoi(text.c_str());
}

// The item of a sequence whose ReferencedSOPInstanceUID is the object's; null: none.
const Json* ItemOf(const Json& answer, const char* sequence, const std::string& instance_uid) {
  if (!answer.is_object() || !answer.contains(sequence)) return nullptr;
  const Json& attribute = answer[sequence];
  if (!attribute.is_object() || !attribute.contains("Value")) return nullptr;
  for (const Json& item : attribute["Value"]) {
    if (JsonValueOf(item, "00081155") == instance_uid) return &item;
  }
  return nullptr;
}

// A name with its groups as in a header: "=" between them.
std::string NameIn(const Json& object, const char* tag) {
  const Json::json_pointer first("/Value/0");
  if (!object.is_object() || !object.contains(tag) || !object[tag].contains(first)) return {};
  const Json& value = object[tag][first];
  std::string name;
  std::string between;
  for (const char* group : {"Alphabetic", "Ideographic", "Phonetic"}) {
    if (value.contains(group) && value[group].is_string()) {
      absl::StrAppend(&name, between, value[group].get<std::string>());
      between.clear();
    }
    between += "=";
  }
  return name;
}

}  // namespace

std::string JsonValueOf(const Json& object, const char* tag) {
  if (!object.is_object() || !object.contains(tag) || !object[tag].is_object()) return {};
  const Json& attribute = object[tag];
  if (!attribute.contains("Value") || !attribute["Value"].is_array() ||
      attribute["Value"].empty()) {
    return {};
  }
  const Json& value = attribute["Value"][0];
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_integer()) return absl::StrCat(value.get<int64_t>());
  if (value.is_number()) return absl::StrCat(static_cast<int64_t>(value.get<double>()));
  return {};
}

SeriesSummary SeriesSummaryFrom(const Json& object) {
  SeriesSummary summary;
  summary.study_uid = JsonValueOf(object, "0020000D");
  summary.series_uid = JsonValueOf(object, "0020000E");
  summary.modality = JsonValueOf(object, "00080060");
  summary.description = JsonValueOf(object, "0008103E");
  summary.study_date = JsonValueOf(object, "00080020");
  summary.patient_id = JsonValueOf(object, "00100020");
  summary.number = NumberIn(object, "00200011");
  summary.instances = NumberIn(object, "00201209");
  return summary;
}

PatientSummary PatientSummaryFrom(const Json& object) {
  PatientSummary patient;
  patient.id = JsonValueOf(object, "00100020");
  patient.issuer = JsonValueOf(object, "00100021");
  patient.birth_date = JsonValueOf(object, "00100030");
  patient.name = NameIn(object, "00100010");
  return patient;
}

absl::Status StatusOfStow(absl::string_view peer_name, const std::string& text,
                          const std::string& instance_uid, int http_status) {
  const Json answer = Json::parse(text, nullptr, false);
  const bool may_be_stored = http_status == kHttpOk || http_status == kHttpAccepted;
  if (may_be_stored && ItemOf(answer, "00081199", instance_uid) != nullptr) return absl::OkStatus();
  const Json* const failed = ItemOf(answer, "00081198", instance_uid);
  if (failed == nullptr && may_be_stored) {
    return absl::UnavailableError(absl::StrCat("the PACS '", peer_name,
                                               "' does not confirm the object ", instance_uid,
                                               ": see its log; tried again"));
  }
  const int reason = failed == nullptr ? 0 : NumberIn(*failed, "00081197");
  if (reason == kDuplicate) return absl::OkStatus();
  const std::string message = absl::StrFormat(
      "the PACS '%s' refuses the object %s with reason 0x%04X", peer_name, instance_uid, reason);
  if ((reason & kReasonKind) == kOutOfResources) {
    return absl::UnavailableError(message + " (it has no room): try again later");
  }
  return absl::FailedPreconditionError(message + ": see its log");
}

}  // namespace tissueform
