// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/calls/status_conversion.h"

#include <algorithm>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/string_view.h"
#include "google/protobuf/util/time_util.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

#include "core/base/error_reason.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

// gRPC's limit for all trailing metadata together is 8 KiB. The message goes twice:
// percent-encoding may triple it, and base64 makes the details a third longer.
constexpr size_t kMaxMessageBytes = 1024;

// Not through the middle of a letter: details are UTF-8, or other languages cannot read them.
std::string Cut(absl::string_view message) {
  size_t size = std::min(message.size(), kMaxMessageBytes);
  while (size < message.size() && size > 0 && (message[size] & 0xC0) == 0x80) --size;
  return std::string(message.substr(0, size));
}

std::string Details(const absl::Status& status, const std::string& message) {
  const ErrorInfo info = ErrorInfoOf(status);
  google::rpc::ErrorInfo proto;
  proto.set_reason(info.reason);
  proto.set_domain("tissueform");
  proto.mutable_metadata()->insert(info.metadata.begin(), info.metadata.end());
  google::rpc::Status details;
  details.set_code(static_cast<int>(status.code()));
  details.set_message(message);
  details.add_details()->PackFrom(proto);
  int64_t wait_ms = 0;
  const auto retry = info.metadata.find("retry_after_ms");
  if (retry != info.metadata.end() && absl::SimpleAtoi(retry->second, &wait_ms)) {
    google::rpc::RetryInfo retry_info;
    *retry_info.mutable_retry_delay() =
        google::protobuf::util::TimeUtil::MillisecondsToDuration(wait_ms);
    details.add_details()->PackFrom(retry_info);
  }
  return details.SerializeAsString();
}

}  // namespace

grpc::Status ToGrpcStatus(const absl::Status& status) {
  if (status.ok()) {
    return grpc::Status::OK;
  }
  const std::string message = Cut(MessageForClients(status));
  return {static_cast<grpc::StatusCode>(status.code()), message, Details(status, message)};
}

}  // namespace tissueform
