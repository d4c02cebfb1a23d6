// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

namespace tissueform {

// A service that is offered or asked for, with the transfer syntaxes that may carry it.
struct ProposedContext {
  std::string abstract_syntax = {};
  std::vector<std::string> transfer_syntaxes = {};
  bool we_receive = false;  // the peer sends these to us (C-GET)
};

// The services, and for C-GET the classes and transfer syntaxes in which images may come.
std::vector<ProposedContext> FindContexts();
std::vector<ProposedContext> MoveContexts();
std::vector<ProposedContext> GetContexts();

}  // namespace tissueform
