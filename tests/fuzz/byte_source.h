// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "absl/strings/string_view.h"

namespace tissueform::fuzz {

// Values one after the other out of the bytes of a fuzzer; zeros when they are used up.
class ByteSource {
 public:
  ByteSource(const uint8_t* data, size_t size) : data_(data), size_(size) {}

  template <typename T>
  T Take() {
    T value{};
    const size_t count = std::min(sizeof(T), size_);
    if (count > 0) std::memcpy(&value, data_, count);
    Skip(count);
    return value;
  }

  absl::string_view TakeBytes(size_t count) {
    const absl::string_view bytes(reinterpret_cast<const char*>(data_), std::min(count, size_));
    Skip(bytes.size());
    return bytes;
  }

  size_t left() const { return size_; }

 private:
  void Skip(size_t count) {
    data_ += count;
    size_ -= count;
  }

  const uint8_t* data_;
  size_t size_;
};

}  // namespace tissueform::fuzz
