// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace tissueform {

// Which connections are open, though other code closes them: a descriptor that is closed, or is
// another file by now, is no longer a connection. One thread at a time.
class ConnectionTable {
 public:
  // Connections at the same time, and of one address.
  ConnectionTable(int most, int most_of_address) : most_(most), most_of_address_(most_of_address) {}

  enum class Verdict { kTaken, kTooMany, kTooManyOfAddress };

  // Counts the connection unless it is one too many. Looks for closed ones first where it would be.
  // `fd` is open; `address` without the port.
  Verdict Take(int fd, const std::string& address);

  int size() const { return static_cast<int>(connections_.size()); }

 private:
  struct Connection {
    uint64_t inode = 0;  // of the socket
    std::string address;
  };

  void ForgetClosed();
  int CountOf(const std::string& address) const;

  const int most_;
  const int most_of_address_;
  std::map<int, Connection> connections_;  // by descriptor
  std::map<std::string, int> counts_;      // by address
};

}  // namespace tissueform
