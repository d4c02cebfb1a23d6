// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "client/pacs_bridge/network/instance_folder.h"
#include "client/pacs_bridge/network/instance_sink.h"
#include "client/pacs_bridge/network/storage_receiver.h"

class DcmTransportLayer;

namespace tissueform {

// What all associations of one receiver share; all outlive them.
struct AssociationContext {
  const ReceiverOptions* options = nullptr;
  DcmTransportLayer* secure = nullptr;  // null: plain
  InstanceFolder* folder = nullptr;
  InstanceSink* sink = nullptr;
  std::atomic<int64_t>* accepted = nullptr;
  std::atomic<int64_t>* refused = nullptr;
  std::atomic<int64_t>* kept = nullptr;
};

// Serves one connection to its end: the request, whether it may, its objects one after the other.
// Owns the socket. `crowded`: refuse it for now.
void ServeAssociation(const AssociationContext& context, int socket, const std::string& address,
                      int64_t number, bool crowded);

}  // namespace tissueform
