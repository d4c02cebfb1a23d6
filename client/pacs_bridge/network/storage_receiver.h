// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/pacs_bridge/network/instance_folder.h"
#include "client/pacs_bridge/network/instance_sink.h"
#include "client/pacs_bridge/network/tls_layer.h"

namespace tissueform {

struct ReceiverOptions {
  std::string address = "127.0.0.1";    // to listen at; "0.0.0.0": all of IPv4
  int port = 0;                         // 0: a free one
  std::string ae_title = "TISSUEFORM";  // by which it must be called
  // The calling AE titles that may send; empty: none.
  std::vector<std::string> calling_ae_titles = {};
  // From where: IPv4 addresses or networks ("10.1.2.0/24").
  std::vector<std::string> addresses = {"127.0.0.1"};
  std::optional<TlsFiles> tls = {};  // none: plain
  int max_associations = 32;         // at once; who comes later is refused for now
  // The longest silence of a peer: while it connects, and within an association.
  std::chrono::seconds connect_time{10};
  std::chrono::seconds idle_time{60};
};

// Counted since the start.
struct ReceiverCounts {
  int64_t associations = 0;  // accepted
  int64_t refused = 0;       // connections and associations that were not
  int64_t kept = 0;          // objects
  int64_t open = 0;          // associations at this moment
};

// A DICOM storage service: takes C-STORE of every storage class in the transfer syntax that the
// sender likes best (but deflated), and C-ECHO. An object is answered with success when it is in
// the folder, synced, and its sink has taken it.
//
// One thread an association. Ends no process: SIGPIPE is ignored from the first one on.
class StorageReceiver {
 public:
  // `folder` and `sink` outlive it. Errors: InvalidArgument (an option), Unavailable (the address
  // is taken), those of MakeTlsLayer and PrepareDcmtk.
  static absl::StatusOr<std::unique_ptr<StorageReceiver>> Start(const ReceiverOptions& options,
                                                                InstanceFolder* folder,
                                                                InstanceSink* sink);
  // Stop.
  virtual ~StorageReceiver() = default;

  virtual int port() const = 0;
  virtual ReceiverCounts Counts() const = 0;
  // Takes no more, breaks off what is open and waits for it.
  virtual void Stop() = 0;
};

}  // namespace tissueform
