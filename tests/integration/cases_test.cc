// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "client/cpp/tissueform_client.h"
#include "core/base/error_reason.h"
#include "core/mesh/payload/sha256.h"
#include "tests/integration/durable_server.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// Cases over the network.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

MATCHER_P(Because, reason, std::string(ReasonName(reason))) {
  *result_listener << GetStatus(arg).ToString();
  return HasReason(GetStatus(arg), reason);
}

// Bytes that no compression makes smaller; different for every seed.
std::string CaseOf(size_t bytes, uint32_t seed = 1) {
  std::string contents(bytes, '\0');
  for (char& byte : contents) {
    seed = seed * 1'664'525 + 1'013'904'223;
    byte = static_cast<char>(seed >> 24);
  }
  return contents;
}

class CasesTest : public ServiceTest {
 protected:
  CaseCalls& calls() { return client_->cases(); }

  const std::unique_ptr<TissueformClient> client_ = Connect();
};

TEST_F(CasesTest, ACaseOfManyChunksIsGivenOutAsItCame) {
  const std::string bytes = CaseOf(5'000'000);
  std::vector<int64_t> progress;
  UploadOptions options;
  options.on_progress = [&progress](int64_t sent, int64_t /*total*/) { progress.push_back(sent); };
  ASSERT_OK_AND_ASSIGN(const v1::Case made, calls().Upload(bytes, "head", options));
  EXPECT_EQ(made.name(), "cases/" + Sha256Hex({bytes}));
  EXPECT_EQ(made.title(), "head");
  EXPECT_EQ(made.total_bytes(), 5'000'000);
  EXPECT_TRUE(std::is_sorted(progress.begin(), progress.end()));
  EXPECT_EQ(progress.back(), 5'000'000);
  progress.clear();
  ASSERT_OK_AND_ASSIGN(const v1::Case again, calls().Upload(bytes, "another", options));
  EXPECT_EQ(again.DebugString(), made.DebugString());
  EXPECT_THAT(progress, IsEmpty()) << "nothing is sent twice";
  ASSERT_OK_AND_ASSIGN(const v1::Case found, calls().Get(made.name()));
  EXPECT_EQ(found.DebugString(), made.DebugString());
  ASSERT_OK_AND_ASSIGN(const std::string read, calls().Read(made.name()));
  EXPECT_TRUE(read == bytes);
}

TEST_F(CasesTest, TheLimitsAreKeptAndTold) {
  ServerOptions options = TestOptions();
  options.limits.max_cases = 1;
  options.limits.max_case_bytes = 1000;
  StartServer(options);
  const auto client = Connect();
  EXPECT_THAT(client->cases().Upload(CaseOf(1001), ""),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("max_case_bytes")));
  ASSERT_THAT(client->cases().Upload(CaseOf(1000), ""), IsOk());
  EXPECT_THAT(client->cases().Upload(CaseOf(900), ""), Because(ErrorReason::kTooManyCases));
  ASSERT_OK_AND_ASSIGN(const v1::ServerInfo info, client->GetServerInfo());
  int64_t cases = 0;
  for (const v1::ServerLimit& limit : info.limits()) {
    if (limit.name() == "max_cases") cases = limit.value();
  }
  EXPECT_EQ(cases, 1);
}

TEST_F(CasesTest, NamesThatAreNoneAreRefused) {
  for (const std::string name : {"", "cases/", "cases/../../etc/passwd", "meshes/0"}) {
    EXPECT_THAT(calls().Get(name), StatusIs(absl::StatusCode::kInvalidArgument)) << name;
    EXPECT_THAT(calls().Delete(name), StatusIs(absl::StatusCode::kInvalidArgument)) << name;
  }
}

TEST(CaseRestartTest, AnAcknowledgedCaseIsThereAfterAKillAndAHalfOneIsSentAgain) {
  DurableServer server("cases", {"--log-level", "warn"});
  ASSERT_THAT(server.Start(), IsOk());
  const std::string bytes = CaseOf(3'000'000);
  const std::string half = CaseOf(3'000'000, 2);
  v1::Case made;
  {
    ASSERT_OK_AND_ASSIGN(const auto client, server.Connect());
    ASSERT_OK_AND_ASSIGN(made, client->cases().Upload(bytes, "kept"));
    // Killed in the middle of the second: it is sent again to the server that comes back.
    bool killed = false;
    UploadOptions options;
    options.on_progress = [&](int64_t sent, int64_t total) {
      if (killed || sent < total / 2) return;
      killed = true;
      EXPECT_THAT(server.Kill(), IsOk());
      EXPECT_THAT(server.Start(), IsOk());
    };
    EXPECT_THAT(client->cases().Upload(half, "", options), IsOk());
    EXPECT_TRUE(killed);
  }
  ASSERT_THAT(server.Kill(), IsOk());
  ASSERT_THAT(server.Start(), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto client, server.Connect());
  ASSERT_OK_AND_ASSIGN(const v1::Case found, client->cases().Get(made.name()));
  EXPECT_EQ(found.DebugString(), made.DebugString());
  ASSERT_OK_AND_ASSIGN(const std::string read, client->cases().Read(made.name()));
  EXPECT_TRUE(read == bytes);
}

}  // namespace
}  // namespace tissueform::testing
