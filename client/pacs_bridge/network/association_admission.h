// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

#include "client/pacs_bridge/network/storage_receiver.h"

struct T_ASC_Association;

// Decides whether a request for an association is accepted, and for what. Refusals are sent back.
namespace tissueform {

// By the AE titles of both sides. `crowded`: no association can be accepted now, from any peer.
//
// Errors, and the association is refused: Unavailable (crowded), PermissionDenied. The message
// contains no text of the other side.
absl::Status AdmitAssociation(const ReceiverOptions& options, T_ASC_Association* association,
                              bool crowded);

// Takes storage classes and verification, each in the transfer syntax that the sender likes best.
// False, and refused: nothing that was offered is taken.
bool NegotiateAssociation(T_ASC_Association* association);

// Without padding.
std::string CallingTitleOf(const T_ASC_Association& association);

}  // namespace tissueform
