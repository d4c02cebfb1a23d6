// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

namespace tissueform::testing {

// What libxml2 finds wrong with a DICOM audit message by audit_message.rng; empty: nothing.
std::string SchemaErrors(const std::string& message);

// The values of an XPath expression, joined by ",".
std::string ValuesOf(const std::string& message, const std::string& xpath);

}  // namespace tissueform::testing
