// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"
#include "google/protobuf/descriptor.h"

// What the gateway knows of the methods that it hands on, from the protocol's own descriptors.
namespace tissueform {

enum class MethodKind {
  kUnary,
  kDownload,  // a stream of the server that ends by itself
  kLong,      // anything else, and what this gateway does not know
};

// `method`: "/tissueform.v1.CaseService/GetCase".
MethodKind KindOf(absl::string_view method);

// What the method answers with; null when this gateway does not know it.
const google::protobuf::Descriptor* AnswerOf(absl::string_view method);

// The position of bytes in a message.
struct BytesPlace {
  uint32_t offset = 0;  // from its first byte
  uint32_t size = 0;    // 0: the message has no bytes
};

// The longest `bytes` field of a serialised message of this type, and of the messages in it. Bytes
// that are not such a message have none.
BytesPlace LongestBytes(absl::string_view message, const google::protobuf::Descriptor& type);

}  // namespace tissueform
