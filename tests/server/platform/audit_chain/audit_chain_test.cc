// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit_chain/audit_chain.h"

#include <cstdio>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include <sys/stat.h>

#include "tests/testing/audit_samples.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using ::testing::Not;
using testing::SampleKey;
using testing::StatusIs;

TEST(AuditChainTest, EveryLineIsAJsonObjectOfItsOwn) {
  for (const std::string& line : testing::LinesOf(testing::SampleLog({3}).front())) {
    const auto object = nlohmann::json::parse(line);
    EXPECT_TRUE(object.at("n").is_number_unsigned());
    EXPECT_EQ(object.at("mac").get<std::string>().size(), 64);
  }
}

// HMAC-SHA-256 by Python's hmac, of 64 noughts and the body, with 32 bytes "k".
TEST(AuditChainTest, TheMacIsTheOneOfTheStandard) {
  AuditChain chain(SampleKey(), {});
  EXPECT_EQ(chain.Seal("\"event\":\"call\""),
            "{\"n\":1,\"event\":\"call\",\"mac\":"
            "\"3e57b27940b951ce46034e61c3a493a3710e5837148226f22b509d1eca2f9312\"}\n");
}

TEST(AuditChainTest, LinesThatWereNotWrittenLeaveNoTrace) {
  AuditChain chain(SampleKey(), {});
  chain.Seal("\"event\":\"a\"");
  const AuditPosition before = chain.position();
  const std::string line = chain.Seal("\"event\":\"b\"");
  chain.GoBackTo(before);
  EXPECT_EQ(chain.Seal("\"event\":\"b\""), line);
}

TEST(AuditKeyTest, AKeyThatWasMadeIsReadAndForItsOwnerOnly) {
  const std::string path = absl::StrCat(::testing::TempDir(), "audit_key_made");
  std::remove(path.c_str());
  ASSERT_THAT(AuditKey::WriteNew(path), IsOk());
  struct stat status = {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600);
  EXPECT_THAT(AuditKey::Read(path), IsOk());
  EXPECT_THAT(AuditKey::WriteNew(path), StatusIs(absl::StatusCode::kAlreadyExists));
}

TEST(AuditKeyTest, WhatIsNoKeyIsRefusedWithoutSayingWhatItIs) {
  const std::string path =
      testing::WriteFile(absl::StrCat(::testing::TempDir(), "audit_key_bad"), "");
  ASSERT_EQ(chmod(path.c_str(), 0600), 0);
  for (const std::string& text :
       {std::string(), std::string(63, 'a'), std::string(65, 'a'), std::string(64, 'g'),
        std::string(1 << 20, 'a'), std::string(64, 'a') + "\n\n"}) {
    testing::WriteFile(path, text);
    EXPECT_THAT(AuditKey::Read(path),
                StatusIs(testing::kInvalid, AllOf(HasSubstr("keygen"), Not(HasSubstr("aaaa")))));
  }
  testing::WriteFile(path, std::string(64, 'a') + "\n");
  EXPECT_THAT(AuditKey::Read(path), IsOk());
  ASSERT_EQ(chmod(path.c_str(), 0640), 0);
  EXPECT_THAT(AuditKey::Read(path),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("chmod 600")));
  EXPECT_THAT(AuditKey::Read(path + ".none"), StatusIs(absl::StatusCode::kNotFound));
}

}  // namespace
}  // namespace tissueform
