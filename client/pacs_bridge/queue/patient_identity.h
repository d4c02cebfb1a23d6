// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <string>

#include "client/pacs_bridge/dicom/instance_header.h"

namespace tissueform {

// Whose a study is, as the images say it: UTF-8, cut to kMaxIdentityBytes each.
inline constexpr size_t kMaxIdentityBytes = 1024;
struct PatientIdentity {
  std::string id = {};
  std::string issuer = {};
  std::string name = {};
  std::string birth_date = {};
  // False: a text could not be read as it was meant (an unknown character set, too long).
  bool readable = true;

  friend bool operator==(const PatientIdentity&, const PatientIdentity&) = default;
};
// What an image says of its patient.
PatientIdentity IdentityOf(const InstanceHeader& image);
// A digest of it, by which a later look sees that something has changed.
std::string DigestOf(const PatientIdentity& patient);

}  // namespace tissueform
