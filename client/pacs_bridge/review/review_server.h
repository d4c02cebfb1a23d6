// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/pacs_bridge/queue/bridge_queue.h"

namespace tissueform {

// A request that gives a password.
struct ReviewLogin {
  std::string address = {};  // of the connection: behind a proxy the proxy's
  std::string user = {};     // as the client states it; may be empty
  bool is_accepted = false;
};

struct ReviewOptions {
  std::string address = "127.0.0.1";
  int port = 8043;  // 0: any free one
  // Names by which browsers reach it, beside its address and those of loopback: behind a proxy.
  std::vector<std::string> allowed_hosts = {};
  // A password of at least 16 characters, by HTTP Basic with any name; mode 0600. Empty: none.
  std::string token_file = {};
  std::string planner_url = {};
  // Hears of each request that gives a password, on any thread. What it does not take of accepted
  // ones is answered with 503. Null: without a listener.
  std::function<absl::Status(const ReviewLogin&)> on_login = nullptr;
};

// The review page: a small web server for those who may see names. It shows what the queue holds,
// and takes a person's word that a prediction is stored in the study of the patient that the page
// has shown; it does nothing else.
//
// A request is answered only when its Host is one of ours (421), with the password where one is set
// (401); a form only when it comes from a page of ours (403): by the token in it, and by Origin
// where a browser says that. Nothing is cached, nothing from elsewhere is loaded, nothing is a
// script. Threads of its own.
class ReviewServer {
 public:
  // `queue` must outlive it; `confirmed` is called after each confirmation, on any thread.
  //
  // Errors: InvalidArgument (other addresses than loopback without a token file; a password that is
  // too short), those of ReadSecretFile, Unavailable (the port is taken).
  static absl::StatusOr<std::unique_ptr<ReviewServer>> Start(const ReviewOptions& options,
                                                             BridgeQueue* queue,
                                                             std::function<void()> confirmed);
  virtual ~ReviewServer() = default;

  virtual int port() const = 0;
};

}  // namespace tissueform
