// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "grpcpp/support/string_ref.h"

#include "client/gateway/http_message.h"
#include "client/gateway/upstream_call.h"

// The metadata of a call that the gateway passes on in addition to its messages: few names, so that
// a client cannot smuggle in fields by which a proxy before the server decides.
namespace tissueform {

// Names that a client may send to the server: authorization, x-tissueform-session,
// x-tissueform-node, traceparent.
bool MayBeSent(absl::string_view name);

// "/tissueform.v1.Service/Method" in letters that gRPC takes, or "/grpc.health.v1.Health/Check".
bool IsServedMethod(absl::string_view method);

// Error: InvalidArgument when a value has other letters than printable ASCII or all are longer than
// 4 KiB: gRPC ends the process of who sends such.
absl::Status CheckMetadata(const std::map<std::string, std::string>& metadata);

// Those of a gRPC-Web request; the other fields that browsers send are left out.
std::map<std::string, std::string> MetadataOf(const HttpHead& head);

// Of `grpc-timeout`: "250m", at most eight digits and a unit of HMSmun.
// Error: InvalidArgument.
absl::StatusOr<std::chrono::nanoseconds> ParseGrpcTimeout(absl::string_view text);

// The part of the server's metadata that a client receives: x-tissueform-*, traceparent; text only,
// at most 4 KiB of it.
std::map<std::string, std::string> AllowedMetadata(
    const std::multimap<grpc::string_ref, grpc::string_ref>& metadata);

}  // namespace tissueform
