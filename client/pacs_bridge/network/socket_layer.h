// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <memory>

#include "absl/status/status.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmnet/assoc.h>
#include <dcmtk/dcmnet/dcmlayer.h>

namespace tissueform {

// What DCMTK's network needs once a process: PrepareDcmtk, no names asked of DNS, SIGPIPE ignored.
// Any thread.
absl::Status PrepareDicomNetwork();

// Puts what is to be done to every socket before DCMTK's own layer: answers are sent at once
// (TCP_NODELAY: with Nagle's algorithm an association carries 22 objects a second), silence ends.
// One connection.
class SocketLayer : public DcmTransportLayer {
 public:
  // `secure` is TLS, or null for plain; both outlive it. `connected` is called with the socket.
  SocketLayer(DcmTransportLayer* secure, std::chrono::seconds silence,
              std::function<void()> connected = nullptr);

  DcmTransportConnection* createConnection(DcmNativeSocketType socket, OFBool is_secure) override;
  // Whether a socket has come: what fails later is no matter of reaching the peer.
  bool has_socket() const { return has_socket_; }

 private:
  DcmTransportLayer plain_;
  DcmTransportLayer* const secure_;
  const std::chrono::seconds silence_;
  const std::function<void()> connected_;
  bool has_socket_ = false;
};

// The longest wait for one read or write of a socket.
void SetSilence(int socket, std::chrono::seconds silence);

// Reads an association request from an accepted socket, and owns it from then on, also when this
// fails. DCMTK can listen in one thread only, where a client that connects and says nothing stops
// all others; so sockets are accepted elsewhere and each is given to it in a thread of its own.
//
// `*network` and `*association` are the caller's to drop, where they are not null.
OFCondition ReceiveAssociationFrom(int socket, DcmTransportLayer* secure,
                                   std::chrono::seconds silence,
                                   std::unique_ptr<SocketLayer>* layer, T_ASC_Network** network,
                                   T_ASC_Association** association);

}  // namespace tissueform
