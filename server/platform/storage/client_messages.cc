// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/storage/client_messages.h"

#include "absl/strings/cord.h"
#include "absl/strings/str_replace.h"

namespace tissueform {
namespace {

constexpr absl::string_view kPathUrl = "type.tissueform/LocalPath";
constexpr absl::string_view kSentenceUrl = "type.tissueform/ForClients";

}  // namespace

absl::Status NamingPath(absl::Status status, absl::string_view path) {
  status.SetPayload(kPathUrl, absl::Cord(path));  // does nothing to an OK status
  return status;
}

absl::Status WithClientMessage(absl::Status status, absl::string_view sentence) {
  status.SetPayload(kSentenceUrl, absl::Cord(sentence));
  return status;
}

bool HasClientMessage(const absl::Status& status) {
  return status.GetPayload(kSentenceUrl).has_value();
}

std::string MessageForClients(const absl::Status& status) {
  if (const auto sentence = status.GetPayload(kSentenceUrl); sentence.has_value()) {
    return std::string(*sentence);
  }
  const std::string message(status.message());
  const auto path = status.GetPayload(kPathUrl);
  if (!path.has_value() || path->empty()) return message;
  return absl::StrReplaceAll(message, {{std::string(*path), "(on the server)"}});
}

}  // namespace tissueform
