// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/file_bytes.h"

#include <string>

#include "tests/core/imaging/ct/packed.h"

namespace tissueform {
namespace {

using tissueform::testing::Pack;

std::string SomeBytes(size_t size) {
  std::string bytes(size, 'a');
  for (size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>((i * i) % 251);
  return bytes;
}

TEST(UnpackedSizeTest, CountsBytesOfGzipAndZlib) {
  for (const size_t size : {size_t{1}, size_t{1000}, size_t{3'000'000}}) {
    for (const bool gzip : {true, false}) {
      EXPECT_EQ(UnpackedSize(Pack(SomeBytes(size), gzip), 1 << 30), size);
    }
  }
}

TEST(UnpackedSizeTest, StreamsOneAfterTheOtherCountTogether) {
  const std::string two = Pack(SomeBytes(70'000), true) + Pack(SomeBytes(30'000), true);
  EXPECT_EQ(UnpackedSize(two, 1 << 30), 100'000);
  EXPECT_EQ(UnpackedSize(two + std::string(512, '\0'), 1 << 30), 100'000);
  EXPECT_EQ(UnpackedSize(two.substr(0, two.size() - 1), 1 << 30), 0);
}

TEST(UnpackedSizeTest, IsZeroForTruncatedOrDamagedData) {
  const std::string whole = Pack(SomeBytes(100'000), true);
  for (const size_t missing : {size_t{1}, size_t{8}, size_t{100}, whole.size() - 2, whole.size()}) {
    EXPECT_EQ(UnpackedSize(whole.substr(0, whole.size() - missing), 1 << 30), 0) << missing;
  }
  std::string damaged = whole;
  damaged[damaged.size() / 2] ^= 0x10;
  EXPECT_EQ(UnpackedSize(damaged, 1 << 30), 0);
}

TEST(UnpackedSizeTest, StopsSoonAfterEnough) {
  std::string long_text;
  long_text.resize(100'000'000, 'a');
  const int64_t size = UnpackedSize(Pack(long_text, true), 1000);
  EXPECT_GE(size, 1000);
  EXPECT_LE(size, 3 << 20);
}

}  // namespace
}  // namespace tissueform
