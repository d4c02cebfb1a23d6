// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace tissueform {

// A globally unique UID: 2.25 and a random UUID (version 4) as a decimal number, which needs no
// root of an organization (PS3.5 B.2). At most 44 characters. Any thread.
std::string NewDicomUid();

// Whether this is a UID by PS3.5 9.1: at most 64 digits and dots, no component empty or with a
// leading zero. What does not pass is never part of a file name or a query.
bool IsDicomUid(absl::string_view text);

// SOP classes that the bridge names; those of CT images are in core/imaging/series.
inline constexpr absl::string_view kVerificationClass = "1.2.840.10008.1.1";
inline constexpr absl::string_view kColourCaptureClass = "1.2.840.10008.5.1.4.1.1.7.4";
inline constexpr absl::string_view kComprehensiveSrClass = "1.2.840.10008.5.1.4.1.1.88.33";
inline constexpr absl::string_view kEncapsulatedStlClass = "1.2.840.10008.5.1.4.1.1.104.3";

// Transfer syntaxes that the bridge names.
inline constexpr absl::string_view kImplicitLittleEndian = "1.2.840.10008.1.2";
inline constexpr absl::string_view kExplicitLittleEndian = "1.2.840.10008.1.2.1";
inline constexpr absl::string_view kDeflatedLittleEndian = "1.2.840.10008.1.2.1.99";

}  // namespace tissueform
