// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/queue/patient_identity.h"

#include "absl/strings/str_cat.h"

#include "core/mesh/payload/sha256.h"

namespace tissueform {

PatientIdentity IdentityOf(const InstanceHeader& image) {
  const auto cut = [](const std::string& text) { return text.substr(0, kMaxIdentityBytes); };
  return {.id = cut(image.patient_id),
          .issuer = cut(image.issuer_of_patient_id),
          .name = cut(image.patient_name),
          .birth_date = cut(image.birth_date),
          .readable = image.text_problem.empty()};
}

std::string DigestOf(const PatientIdentity& patient) {
  const std::string lengths = absl::StrCat(patient.id.size(), " ", patient.issuer.size(), " ",
                                           patient.name.size(), " ", patient.readable);
  return Sha256Hex({lengths, patient.id, patient.issuer, patient.name, patient.birth_date});
}

}  // namespace tissueform
