// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>
#include <string_view>

#include "absl/status/status.h"

#include "server/access/auth/identity.h"

namespace tissueform {

// What a call asks for.
enum class CallKind {
  kNewWork,   // refused while the server drains
  kMetadata,  // looks or tidies up: always welcome
  kStream,    // new work for as long as its client likes: a drag, a watch
};

// What is known of a call. Views and references live as long as the call of the observer.
struct ObservedCall {
  std::string_view method;  // "MeshService.GetMesh"
  CallKind kind;
  const Principal& principal;
  std::string_view resource;     // "sessions/{id}"; empty where none is named yet
  std::string_view address;      // of the client, without its port; empty where there is no network
  std::string_view request_id;   // well formed
  std::string_view traceparent;  // well formed, or empty
  bool served = false;           // OnBegin was OK
};

// Receives every call: metrics, audit. Thread-safe; called on gRPC's threads and on workers, so it
// must not block.
class CallObserver {
 public:
  virtual ~CallObserver() = default;

  // A call that is served begins. Errors: why it is not served after all (an audit that cannot be
  // written).
  virtual absl::Status OnBegin(const ObservedCall& call) = 0;
  // It has named its resource, and may use it.
  virtual void OnResource(const ObservedCall& call) = 0;
  // It is over, served or not. Once for every call.
  virtual void OnEnd(const ObservedCall& call, const absl::Status& outcome,
                     std::chrono::steady_clock::duration elapsed) = 0;
};

}  // namespace tissueform
