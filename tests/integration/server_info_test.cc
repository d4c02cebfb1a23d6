// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <map>
#include <string>
#include <thread>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "proto/conversion/geometry_conversion.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// What a server says of itself is what it does.
namespace tissueform::testing {
namespace {

using ::testing::IsEmpty;
using ::testing::Not;

class ServerInfoTest : public ServiceTest {
 protected:
  v1::ServerInfo Info() {
    const auto info = Connect()->GetServerInfo();
    EXPECT_THAT(info, IsOk());
    return info.value_or(v1::ServerInfo());
  }
  std::map<std::string, int64_t> Limits() {
    std::map<std::string, int64_t> limits;
    const v1::ServerInfo info = Info();
    for (const v1::ServerLimit& limit : info.limits()) {
      EXPECT_TRUE(limits.emplace(limit.name(), limit.value()).second) << limit.name();
    }
    return limits;
  }
};

TEST_F(ServerInfoTest, VersionAndLimitsAreThoseOfTheServer) {
  ServerOptions options = TestOptions();
  options.limits.max_sessions = 7;
  options.limits.upload_silence = std::chrono::milliseconds(1234);
  options.limits.session_idle_ttl = std::chrono::seconds(5);
  options.limits.retention_days = 3;
  options.memory_budget_bytes = int64_t{5} << 30;
  StartServer(options);
  const v1::ServerInfo info = Info();
  EXPECT_EQ(info.api_version(), "tissueform.v1");
  EXPECT_THAT(info.version(), Not(IsEmpty()));
  EXPECT_THAT(info.commit(), Not(IsEmpty()));
  const auto limits = Limits();
  EXPECT_EQ(limits.at("max_sessions"), 7);
  EXPECT_EQ(limits.at("retention_days"), 3);
  EXPECT_EQ(limits.at("upload_silence_ms"), 1234);
  EXPECT_EQ(limits.at("session_idle_ttl_ms"), 5000);
  EXPECT_EQ(limits.at("memory_budget_bytes"), int64_t{5} << 30);
}

TEST_F(ServerInfoTest, ModelsSupportTheirAdvertisedFeatures) {
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), BarProblem(6));
  const v1::ServerInfo info = Info();
  EXPECT_EQ(info.models_size(), v1::DeformationModel_descriptor()->value_count() - 1);
  for (const v1::ModelInfo& model : info.models()) {
    SCOPED_TRACE(model.name());
    DeformStream::Options prepared;
    prepared.model = model.model();
    prepared.prepared.emplace();
    const auto stream = client->OpenStream(session.name(), prepared);
    EXPECT_EQ(stream.ok(), model.has_prepared_answers()) << stream.status();
    ASSERT_OK_AND_ASSIGN(const auto answer, client->DeformOnce(session.name(), TopPose(SomePose(2)),
                                                               {}, model.model()));
    // Models that do not iterate find an answer by one solve.
    EXPECT_EQ(answer.summary().iterations() > 1, model.iterates());
  }
}

TEST_F(ServerInfoTest, EncodingsAreThoseThatAreTaken) {
  const v1::ServerInfo info = Info();
  EXPECT_THAT(info.encodings(), ::testing::Contains(v1::POSITION_ENCODING_FLOAT32));
  for (const int encoding : info.encodings()) {
    EXPECT_THAT(CheckEncoding(static_cast<v1::PositionEncoding>(encoding)), IsOk());
  }
}

TEST_F(ServerInfoTest, ADrainingServerStillAnswersAndSaysSo) {
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), BarProblem(6));
  ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), {}));
  EXPECT_FALSE(Info().draining());
  std::thread drain([this] { server().Drain(); });
  EXPECT_TRUE(Eventually([&] {
    const auto info = client->GetServerInfo();
    return info.ok() && info->draining();
  }));
  stream->Cancel();
  drain.join();
}

}  // namespace
}  // namespace tissueform::testing
