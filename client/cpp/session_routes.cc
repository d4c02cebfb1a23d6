// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/session_routes.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/string_view.h"

#include "client/cpp/client_call.h"
#include "core/base/error_reason.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {
namespace {

constexpr size_t kMaxNodeBytes = 64;

bool IsNodeName(absl::string_view name) {
  return !name.empty() && name.size() <= kMaxNodeBytes &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return absl::ascii_isalnum(c) || c == '-' || c == '_' || c == '.' || c == ':';
         });
}

// A session that another server holds, and a server that is away or says that it is not meant. Not
// CANCELLED, which is one's own.
bool IsElsewhere(const absl::Status& error) {
  return absl::IsUnavailable(error) || absl::IsUnknown(error) || absl::IsInternal(error);
}

}  // namespace

std::string NodeIn(const absl::Status& error) {
  if (!HasReason(error, ErrorReason::kSessionMoved) &&
      !HasReason(error, ErrorReason::kMemoryBudgetFull)) {
    return {};
  }
  const ErrorInfo info = ErrorInfoOf(error);
  const auto node = info.metadata.find("node");
  return node != info.metadata.end() && IsNodeName(node->second) ? node->second : std::string();
}

std::string SessionRoutes::NodeOf(const std::string& session) {
  MutexLock lock(mutex_);
  const auto found = places_.find(session);
  if (found == places_.end()) return {};
  routes_.splice(routes_.begin(), routes_, found->second);
  return found->second->second;
}

void SessionRoutes::Remember(const std::string& session, const std::string& node) {
  if (!IsNodeName(node)) return;
  in_cluster_ = true;
  if (session.empty()) return;
  MutexLock lock(mutex_);
  if (const auto found = places_.find(session); found != places_.end()) {
    found->second->second = node;
    routes_.splice(routes_.begin(), routes_, found->second);
    return;
  }
  routes_.emplace_front(session, node);
  places_[session] = routes_.begin();
  if (routes_.size() > most_) {
    places_.erase(routes_.back().first);
    routes_.pop_back();
  }
}

void SessionRoutes::Forget(const std::string& session) {
  MutexLock lock(mutex_);
  const auto found = places_.find(session);
  if (found == places_.end()) return;
  routes_.erase(found->second);
  places_.erase(found);
}

void SessionRoutes::LearnFrom(const absl::Status& error, const std::string& session) {
  if (HasReason(error, ErrorReason::kSessionMoved) || HasReason(error, ErrorReason::kWrongNode)) {
    in_cluster_ = true;
  }
  if (const std::string node = NodeIn(error); !node.empty()) {
    Remember(session, node);
  } else if (IsElsewhere(error)) {
    Forget(session);
  }
}

size_t SessionRoutes::size() const {
  MutexLock lock(mutex_);
  return routes_.size();
}

void SessionRoutes::AddHeaders(const std::string& session, grpc::ClientContext* context) {
  AddSessionHeader(session, context);
  if (const std::string node = NodeOf(session); !node.empty()) {
    context->AddMetadata(kNodeHeader, node);
  }
}

}  // namespace tissueform
