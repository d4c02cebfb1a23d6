// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctagkey.h>
#include <dcmtk/dcmnet/assoc.h>

#include "client/pacs_bridge/network/pacs_client.h"
#include "client/pacs_bridge/network/proposed_contexts.h"
#include "client/pacs_bridge/network/socket_layer.h"

namespace tissueform {

// Errors: InvalidArgument, what an AE title is.
absl::Status CheckAeTitle(const std::string& title);

// An association that we have asked a PACS for. One thread.
class DimseAssociation {
 public:
  // At most 128 contexts. `secure` is TLS or null, and outlives it. Errors: those of PacsClient.
  static absl::StatusOr<std::unique_ptr<DimseAssociation>> Request(
      const PacsPeer& peer, DcmTransportLayer* secure,
      const std::vector<ProposedContext>& contexts);
  // Releases it, or aborts when something has failed.
  ~DimseAssociation();
  DimseAssociation(const DimseAssociation&) = delete;
  DimseAssociation& operator=(const DimseAssociation&) = delete;

  T_ASC_Association* get() const { return association_; }
  T_ASC_Network* network() const { return network_; }

  // The context by which a service, or a class in a transfer syntax, goes. Errors: Unimplemented
  // when the peer has not taken the service, FailedPrecondition when it has not taken the class.
  absl::StatusOr<T_ASC_PresentationContextID> ContextOf(const std::string& abstract_syntax,
                                                        const std::string& transfer_syntax = {});

  // OK, or what it means that DCMTK's call failed; then no more is asked of it.
  absl::Status Check(const OFCondition& condition, absl::string_view what);

 private:
  explicit DimseAssociation(std::string peer_name) : peer_name_(std::move(peer_name)) {}

  absl::Status Open(const PacsPeer& peer, DcmTransportLayer* secure,
                    const std::vector<ProposedContext>& contexts);

  const std::string peer_name_;
  std::unique_ptr<SocketLayer> layer_;
  T_ASC_Network* network_ = nullptr;
  T_ASC_Association* association_ = nullptr;
  bool broken_ = false;
};

}  // namespace tissueform
