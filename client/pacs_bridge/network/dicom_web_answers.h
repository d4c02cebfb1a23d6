// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include <nlohmann/json.hpp>

#include "client/pacs_bridge/network/pacs_client.h"

// What a PACS says by DICOMweb, in DICOM's JSON (PS3.18 F).
namespace tissueform {

// The first value of an attribute ("0020000D"), as text; empty: none.
std::string JsonValueOf(const nlohmann::json& object, const char* tag);

SeriesSummary SeriesSummaryFrom(const nlohmann::json& object);
PatientSummary PatientSummaryFrom(const nlohmann::json& object);

// Whether STOW-RS has stored an object that was sent alone: `text` is what the PACS answers with
// HTTP status 200, 202 (stored with warnings) or 409 (refused). It is stored only where it is
// listed as stored. So is a duplicate: only this bridge uses our UIDs, so it was sent before.
//
// Errors, one line with UID and reason: Unavailable (the PACS has no room, or says nothing of the
// object: Orthanc 1.10 with a full disk answers 200 and two empty lists), FailedPrecondition (it
// refuses it).
absl::Status StatusOfStow(absl::string_view peer_name, const std::string& text,
                          const std::string& instance_uid, int http_status);

}  // namespace tissueform
