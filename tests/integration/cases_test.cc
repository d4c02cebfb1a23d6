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
#include "core/mesh/payload/sha256.h"
#include "tests/integration/durable_server.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// Cases over the network.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Bytes that no compression makes smaller.
std::string CaseOf(size_t bytes) {
  std::string contents(bytes, '\0');
  uint32_t seed = 1;
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
  ASSERT_OK_AND_ASSIGN(const std::string read, calls().Read(made.name()));
  EXPECT_TRUE(read == bytes);
}

TEST_F(CasesTest, ACaseOverTheLimitIsRefused) {
  ServerOptions options = TestOptions();
  options.limits.max_case_bytes = 1000;
  StartServer(options);
  const auto client = Connect();
  EXPECT_THAT(client->cases().Upload(CaseOf(1001), ""),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("max_case_bytes")));
  EXPECT_THAT(client->cases().Upload(CaseOf(1000), ""), IsOk());
}

TEST_F(CasesTest, RefusesInvalidNames) {
  for (const std::string name : {"", "cases/", "cases/../../etc/passwd", "meshes/0"}) {
    EXPECT_THAT(calls().Get(name), StatusIs(absl::StatusCode::kInvalidArgument)) << name;
    EXPECT_THAT(calls().Delete(name), StatusIs(absl::StatusCode::kInvalidArgument)) << name;
  }
}

TEST(CaseRestartTest, AHalfCaseIsSentAgainToTheServerThatComesBack) {
  DurableServer server("cases", {"--log-level", "warn"});
  ASSERT_THAT(server.Start(), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto client, server.Connect());
  bool killed = false;
  UploadOptions options;
  options.on_progress = [&](int64_t sent, int64_t total) {
    if (killed || sent < total / 2) return;
    killed = true;
    EXPECT_THAT(server.Kill(), IsOk());
    EXPECT_THAT(server.Start(), IsOk());
  };
  EXPECT_THAT(client->cases().Upload(CaseOf(3'000'000), "", options), IsOk());
  EXPECT_TRUE(killed);
}

}  // namespace
}  // namespace tissueform::testing
