// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace tissueform {

// syslog's MSGID for messages of PS3.15 A.5.
inline constexpr char kDicomAuditMessageId[] = "DICOM+RFC3881";

// A process that takes part in an event.
struct AuditParticipant {
  enum class Role { kNone, kApplication, kSource, kDestination };

  Role role = Role::kNone;
  std::string user_id = {};   // AE title, URL, or process id
  std::string ae_title = {};  // empty: not known, or none
  std::string host = {};      // name, address or URL; empty: not known
  bool is_requestor = false;
};

// Objects of one study that were transferred.
struct AuditedStudy {
  std::string study_uid = {};
  std::string patient_id = {};  // UTF-8; empty: not known
  std::map<std::string, int> objects_of_class = {};
};

struct AuditEvent {
  enum class Kind {
    kApplicationStart,
    kApplicationStop,
    kQuery,
    kTransferBegin,
    kTransferred,
    kLogin,        // to the review page
    kNodeRefused,  // a security alert: the PACS or we refuse the other side, or TLS fails
  };

  Kind kind = Kind::kApplicationStart;
  absl::Time time = {};
  absl::Status outcome = {};
  std::string source = {};  // the bridge that reports it
  std::vector<AuditParticipant> participants = {};
  std::optional<AuditedStudy> study = {};
  std::string query = {};  // the identifier of a C-FIND, explicit VR little endian
};

// The event as an XML audit message of PS3.15 A.5.1, one line of printable ASCII. Names the
// patient's ID, which the standard's receiver needs, and neither name nor birth date.
std::string ToAuditMessage(const AuditEvent& event);

}  // namespace tissueform
