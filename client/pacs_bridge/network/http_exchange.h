// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/pacs_bridge/network/pacs_client.h"
#include "server/platform/http/http_client.h"

namespace tissueform {

struct PacsHttpRequest {
  std::string path = {};  // after the peer's URL: "/studies?limit=1"
  std::vector<std::string> headers = {};
  const std::string* body = nullptr;  // null: GET; otherwise POST
};

// Takes the body of an answer of status 200, piece by piece, with the answer's content type.
// An error ends the exchange and is its error.
using TakeBody =
    std::function<absl::Status(const std::string& content_type, absl::string_view piece)>;

// Errors: InvalidArgument when it is no URL, holds a password, or is http for another machine.
absl::Status CheckPacsUrl(const PacsPeer& peer);

// Sends one request. An answer of any status is returned: the body of status 200 goes to `take`, of
// others the first 64 KiB are in the answer. REQUIRES: CheckPacsUrl.
//
// Errors: those of PacsClient, and of `take`.
absl::StatusOr<HttpAnswer> Exchange(const PacsPeer& peer, const PacsHttpRequest& request,
                                    const TakeBody& take);

}  // namespace tissueform
