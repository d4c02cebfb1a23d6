// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"

#include "server/platform/connection_table.h"

namespace tissueform {

// Raises the limit of open descriptors of this process to what it may be, and returns it.
int RaiseDescriptorLimit();

// Accepts connections and hands them on, no more than may be open at a time. gRPC 1.51's own
// listener stops for good when the process runs out of descriptors (CVE-2023-4785, not fixed in
// Debian): this one keeps a spare descriptor, turns away surplus connections, and goes on.
//
// Thread-safe.
class ConnectionListener {
 public:
  struct Options {
    std::string host;  // address or name
    int port = 0;      // 0: any free one
    int most = 1024;   // connections at the same time
    int most_of_address = 512;
    // The options of the program that choose another address, for the error.
    std::string chosen_by = "--port or --host";
  };
  // Takes the connection over: a non-blocking socket, and the listener's descriptor.
  using Handle = std::function<void(int fd, int listener_fd)>;

  // Listens when it returns, but accepts nothing before Start.
  //
  // Errors: Unavailable, naming the address, when it cannot be listened on.
  static absl::StatusOr<std::unique_ptr<ConnectionListener>> Listen(const Options& options);
  // Stop.
  ~ConnectionListener();
  ConnectionListener(const ConnectionListener&) = delete;
  ConnectionListener& operator=(const ConnectionListener&) = delete;

  int port() const { return port_; }

  // Once. `handle` is called from the listener's thread.
  void Start(Handle handle);
  // Accepts nothing more and closes the port. May be called twice.
  void Stop();

 private:
  explicit ConnectionListener(const Options& options);

  absl::Status Bind(const Options& options);
  void AcceptUntilStopped();
  // False when nothing waits.
  bool AcceptOne(int listener_fd);
  // Out of descriptors: frees the spare one for a moment, so that a waiting connection is turned
  // away instead of waiting forever. False: no connection waits.
  bool TurnOneAway(int listener_fd);
  void LogRefusals();

  // Constant after Listen.
  int port_ = 0;
  std::vector<int> listener_fds_;
  int stop_fd_ = -1;

  // The thread's.
  Handle handle_;
  ConnectionTable table_;
  int spare_fd_ = -1;
  int refused_ = 0;  // since the last log line
  std::thread thread_;
};

}  // namespace tissueform
