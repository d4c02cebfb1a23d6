// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <iterator>
#include <string>

#include "tests/integration/served_model.h"
#include "tissueform/v1/session.pb.h"
#include "tissueform/v1/session_service.pb.h"

// What calls of the model-based test ask for, by numbers that were drawn: most of it legal.
namespace tissueform::testing {

inline constexpr auto kOwnModel = v1::DEFORMATION_MODEL_UNSPECIFIED;
inline constexpr auto kNoModel = static_cast<v1::DeformationModel>(99);

// Of sessions, by those who make them.
std::string ChosenId(uint32_t number);
std::string SomeMesh(uint32_t number);
v1::DeformationModel SomeModel(uint32_t number);
int SomePoseNumber(uint32_t number);
// Of a list: sizes that are legal, and one that is not.
int32_t SomePageSize(uint32_t number);

template <typename Map>
std::string NthName(const Map& map, uint32_t number) {
  return std::next(map.begin(), number % map.size())->first;
}

struct ModelUpdate {
  v1::UpdateSessionRequest request;
  std::string words;
  bool changes = true;
  bool legal = true;
};

// Without the session's name and etag. The regions of all meshes of the model are the same.
ModelUpdate SomeUpdate(uint32_t number);
// Does it; the etag is to be learned.
void Apply(const v1::UpdateSessionRequest& request, ServedSession* session);

}  // namespace tissueform::testing
