// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace tissueform {

// Who may see the review page, as its server asks it of a request's headers.

// Takes as long for every text of one length. REQUIRES: a secret that is not empty.
bool IsSameSecret(const std::string& given, const std::string& secret);

// Whether a header `Authorization` is HTTP Basic with this password and any name.
bool IsBasicPassword(const std::string& authorization, const std::string& password);

// The name in a header `Authorization` of HTTP Basic; empty if the header does not have one.
std::string BasicName(const std::string& authorization);

// The first line's worth of a password file, without blanks around it.
//
// Errors: InvalidArgument: it cannot be read, others may read it, or it is too short.
absl::StatusOr<std::string> ReadReviewPassword(const std::string& path);

// Whether it is an address of this machine alone.
bool IsLoopbackAddress(const std::string& address);

// "planner.example.org" of "planner.example.org:8043"; IPv6 stays in its brackets.
std::string HostWithoutPort(const std::string& host);

}  // namespace tissueform
