// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/audit/audit_message.h"

#include <cstdint>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"

namespace tissueform {
namespace {

constexpr size_t kMaxTextBytes = 256;
constexpr char kDcm[] = "DCM";
constexpr char kStudyRootFind[] = "1.2.840.10008.5.1.4.1.2.2.1";
constexpr char kExplicitLittleEndian[] = "1.2.840.10008.1.2.1";

struct Code {
  const char* code;
  const char* system;
  const char* text;
};
struct KindCodes {
  Code event;
  Code type;  // code null: none
  char action;
};

// PS3.16 D, CID 400 and 401; the actions of PS3.15 A.5.3.
KindCodes CodesOf(AuditEvent::Kind kind) {
  constexpr Code kActivity = {"110100", kDcm, "Application Activity"};
  switch (kind) {
    case AuditEvent::Kind::kApplicationStart:
      return {kActivity, {"110120", kDcm, "Application Start"}, 'E'};
    case AuditEvent::Kind::kApplicationStop:
      return {kActivity, {"110121", kDcm, "Application Stop"}, 'E'};
    case AuditEvent::Kind::kQuery:
      return {{"110112", kDcm, "Query"}, {}, 'E'};
    case AuditEvent::Kind::kTransferBegin:
      return {{"110102", kDcm, "Begin Transferring DICOM Instances"}, {}, 'E'};
    case AuditEvent::Kind::kTransferred:
      return {{"110104", kDcm, "DICOM Instances Transferred"}, {}, 'C'};
    case AuditEvent::Kind::kLogin:
      return {{"110114", kDcm, "User Authentication"}, {"110122", kDcm, "Login"}, 'E'};
    case AuditEvent::Kind::kNodeRefused:
      break;
  }
  return {{"110113", kDcm, "Security Alert"}, {"110126", kDcm, "Node Authentication"}, 'E'};
}

// The code point at the front of UTF-8, which is taken off; '?' for what is not valid in XML.
uint32_t TakeCodePoint(absl::string_view* text) {
  const auto first = static_cast<unsigned char>(text->front());
  text->remove_prefix(1);
  const int more = first < 0x80    ? 0
                   : first >= 0xF0 ? 3
                   : first >= 0xE0 ? 2
                   : first >= 0xC0 ? 1
                                   : -1;
  if (more < 0 || text->size() < static_cast<size_t>(more)) return '?';
  uint32_t point = more == 0 ? first : first & (0x3FU >> more);
  for (int i = 0; i < more; ++i) {
    const auto next = static_cast<unsigned char>((*text)[static_cast<size_t>(i)]);
    if ((next & 0xC0U) != 0x80) return '?';
    point = (point << 6) | (next & 0x3FU);
  }
  text->remove_prefix(static_cast<size_t>(more));
  const bool is_valid = point >= 0x20 && !(point >= 0xD800 && point <= 0xDFFF) && point < 0xFFFE;
  return is_valid || (point >= 0x10000 && point <= 0x10FFFF) ? point : '?';
}

// For the value of an attribute or the text of an element.
std::string Escaped(absl::string_view text) {
  text = text.substr(0, kMaxTextBytes);
  std::string escaped;
  while (!text.empty()) {
    const uint32_t point = TakeCodePoint(&text);
    if (point > '~' || absl::StrContains("<>&\"'", static_cast<char>(point))) {
      absl::StrAppend(&escaped, "&#", point, ";");
    } else {
      escaped += static_cast<char>(point);
    }
  }
  return escaped;
}

std::string XmlAttribute(const char* name, absl::string_view value) {
  return absl::StrCat(" ", name, "=\"", Escaped(value), "\"");
}

std::string Coded(const char* element, const Code& code) {
  return absl::StrCat("<", element, XmlAttribute("csd-code", code.code),
                      XmlAttribute("codeSystemName", code.system),
                      XmlAttribute("originalText", code.text), "/>");
}

std::string Identification(const AuditEvent& event) {
  const KindCodes codes = CodesOf(event.kind);
  const bool failed = !event.outcome.ok() || event.kind == AuditEvent::Kind::kNodeRefused;
  std::string xml = absl::StrCat(
      "<EventIdentification", XmlAttribute("EventActionCode", std::string(1, codes.action)),
      XmlAttribute("EventDateTime",
                   absl::FormatTime("%Y-%m-%d%ET%H:%M:%E3SZ", event.time, absl::UTCTimeZone())),
      XmlAttribute("EventOutcomeIndicator", failed ? "8" : "0"), ">",
      Coded("EventID", codes.event));
  if (codes.type.code != nullptr) xml += Coded("EventTypeCode", codes.type);
  if (!event.outcome.ok()) {
    absl::StrAppend(&xml, "<EventOutcomeDescription>", Escaped(event.outcome.message()),
                    "</EventOutcomeDescription>");
  }
  return xml + "</EventIdentification>";
}

// PS3.15 A.5.1: 1 a machine's name, 2 an IP address, 5 a URI.
const char* HostType(const std::string& host) {
  if (absl::StrContains(host, "://")) return "5";
  const bool is_address =
      host.find_first_not_of("0123456789.") == std::string::npos || absl::StrContains(host, ':');
  return is_address ? "2" : "1";
}

std::string Participant(const AuditParticipant& participant) {
  std::string xml =
      absl::StrCat("<ActiveParticipant", XmlAttribute("UserID", participant.user_id),
                   XmlAttribute("UserIsRequestor", participant.is_requestor ? "true" : "false"));
  if (!participant.ae_title.empty()) {
    xml += XmlAttribute("AlternativeUserID", absl::StrCat("AETITLES=", participant.ae_title));
  }
  if (!participant.host.empty()) {
    xml += XmlAttribute("NetworkAccessPointID", participant.host);
    xml += XmlAttribute("NetworkAccessPointTypeCode", HostType(participant.host));
  }
  xml += ">";
  switch (participant.role) {
    case AuditParticipant::Role::kNone:
      break;
    case AuditParticipant::Role::kApplication:
      xml += Coded("RoleIDCode", {"110150", kDcm, "Application"});
      break;
    case AuditParticipant::Role::kSource:
      xml += Coded("RoleIDCode", {"110153", kDcm, "Source Role ID"});
      break;
    case AuditParticipant::Role::kDestination:
      xml += Coded("RoleIDCode", {"110152", kDcm, "Destination Role ID"});
      break;
  }
  return xml + "</ActiveParticipant>";
}

// `inside` comes after the code of the ID's type.
std::string Object(absl::string_view id, const char* type, const char* role, const Code& id_type,
                   absl::string_view inside) {
  return absl::StrCat("<ParticipantObjectIdentification", XmlAttribute("ParticipantObjectID", id),
                      XmlAttribute("ParticipantObjectTypeCode", type),
                      XmlAttribute("ParticipantObjectTypeCodeRole", role), ">",
                      Coded("ParticipantObjectIDTypeCode", id_type), inside,
                      "</ParticipantObjectIdentification>");
}

std::string Study(const AuditedStudy& study) {
  std::string inside = "<ParticipantObjectName/>";
  if (!study.objects_of_class.empty()) {
    inside += "<ParticipantObjectDescription>";
    for (const auto& [uid, count] : study.objects_of_class) {
      absl::StrAppend(&inside, "<SOPClass", XmlAttribute("UID", uid),
                      XmlAttribute("NumberOfInstances", absl::StrCat(count)), "/>");
    }
    inside += "</ParticipantObjectDescription>";
  }
  std::string xml =
      Object(study.study_uid, "2", "3", {"110180", kDcm, "Study Instance UID"}, inside);
  if (!study.patient_id.empty()) {
    xml += Object(study.patient_id, "1", "1", {"2", "RFC-3881", "Patient Number"},
                  "<ParticipantObjectName/>");
  }
  return xml;
}

std::string Query(const std::string& query) {
  return Object(
      kStudyRootFind, "2", "3", {"110181", kDcm, "SOP Class UID"},
      absl::StrCat("<ParticipantObjectQuery>", absl::Base64Escape(query),
                   "</ParticipantObjectQuery><ParticipantObjectDetail",
                   XmlAttribute("type", "TransferSyntax"),
                   XmlAttribute("value", absl::Base64Escape(kExplicitLittleEndian)), "/>"));
}

}  // namespace

std::string ToAuditMessage(const AuditEvent& event) {
  std::string xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?><AuditMessage>";
  xml += Identification(event);
  for (const AuditParticipant& participant : event.participants) xml += Participant(participant);
  absl::StrAppend(&xml, "<AuditSourceIdentification", XmlAttribute("AuditSourceID", event.source),
                  "><AuditSourceTypeCode", XmlAttribute("csd-code", "4"),
                  "/></AuditSourceIdentification>");
  if (!event.query.empty()) xml += Query(event.query);
  if (event.study.has_value()) xml += Study(*event.study);
  return xml + "</AuditMessage>";
}

}  // namespace tissueform
