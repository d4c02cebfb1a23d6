// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <thread>

namespace tissueform::testing {

// How an association ends in the middle of an object.
enum class WireEnd {
  kClosed,   // the cable is pulled: in the middle of a PDU, and nothing more is said
  kAborted,  // an A-ABORT follows the last whole PDU
};

// A wire of loopback to a port, over which one connection goes until its sender has sent so many
// bytes.
class CutWire {
 public:
  CutWire(int port, int64_t bytes, WireEnd end);
  ~CutWire();
  CutWire(const CutWire&) = delete;
  CutWire& operator=(const CutWire&) = delete;

  int port() const { return port_; }

 private:
  void Run();
  // What the sender says next: a whole PDU. Empty at its end.
  static std::string ReadPdu(int socket);

  const int target_;
  const int64_t bytes_;
  const WireEnd end_;
  const int listener_;
  int port_ = 0;
  std::thread thread_;
};

}  // namespace tissueform::testing
