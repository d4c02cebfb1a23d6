// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

namespace tissueform {

// An rpc of the protocol, by the name that CallScope has for it.
struct Rpc {
  std::string name;      // "MeshService.GetMesh"
  bool streams = false;  // on either side
};

// All of package tissueform.v1, in the order of services and methods.
std::vector<Rpc> AllRpcs();

}  // namespace tissueform
