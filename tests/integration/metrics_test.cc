// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/integration/service_test.h"
#include "tests/testing/http_get.h"
#include "tests/testing/status_matchers.h"

// The page of metrics of a server that works.
namespace tissueform::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kPlanted[] = "PLANTED-Mustermann";

class MetricsTest : public ServiceTest {
 protected:
  void SetUp() override {
    ServerOptions options = TestOptions();
    options.telemetry.metrics_port = 0;
    StartServer(options);
  }

  std::string Page() { return HttpGet(server().metrics_port(), "/metrics"); }

  // The value of a line of the page; -1 without that line.
  double Value(const std::string& line) {
    const std::string page = Page();
    const size_t start = page.find(absl::StrCat("\n", line, " "));
    double value = -1;
    if (start == std::string::npos) return value;
    const size_t from = start + line.size() + 2;
    if (!absl::SimpleAtod(page.substr(from, page.find('\n', from) - from), &value)) return -1;
    return value;
  }

  // Makes a session, and drags it once in lockstep.
  void Drag(int num_poses) {
    const BarProblem problem(1);
    const auto client = Connect();
    const v1::Session session = MakeSession(client.get(), problem);
    ASSERT_OK_AND_ASSIGN(const auto stream, client->OpenStream(session.name(), {}));
    for (int i = 1; i <= num_poses; ++i) {
      ASSERT_THAT(stream->SendPoses(i, TopPose(SomePose(i))), IsOk());
      ASSERT_TRUE(stream->Receive().has_value());
      ASSERT_THAT(stream->Ack(i), IsOk());
    }
    stream->CloseSending();
    EXPECT_THAT(stream->Finish(), IsOk());
  }
};

TEST_F(MetricsTest, ADragIsSeen) {
  Drag(5);
  EXPECT_EQ(Value("tissueform_poses_total"), 5);
  EXPECT_EQ(Value("tissueform_frames_total"), 5);
  EXPECT_EQ(Value("tissueform_frame_latency_seconds_count"), 5);
  EXPECT_EQ(Value("tissueform_picture_age_seconds_count"), 5);
  EXPECT_EQ(Value("tissueform_calls_total{code=\"OK\",rpc=\"SessionService.CreateSession\"}"), 1);
  EXPECT_EQ(Value("tissueform_sessions{place=\"memory\"}"), 1);
  EXPECT_GT(Value("tissueform_memory_reserved_bytes{kind=\"meshes\"}"), 0);
  EXPECT_GT(Value("tissueform_memory_reserved_bytes{kind=\"sessions\"}"), 0);
  EXPECT_GT(Value("tissueform_job_wait_seconds_count{lane=\"batch\"}"), 0);
  EXPECT_TRUE(Eventually([this] {
    return Value("tissueform_calls_total{code=\"OK\",rpc=\"DeformService.Deform\"}") == 1;
  }));
  EXPECT_EQ(Value("tissueform_calls_open{rpc=\"DeformService.Deform\"}"), 0);
}

TEST_F(MetricsTest, PromtoolReportsNoProblems) {
  if (std::system("promtool --version > /dev/null 2>&1") != 0) {
    GTEST_SKIP() << "promtool is missing: deploy/packages.txt lists prometheus";
  }
  Drag(2);
  const std::string page = Page();
  const std::string path = absl::StrCat(::testing::TempDir(), "metrics_page.txt");
  std::ofstream(path) << page.substr(page.find("\r\n\r\n") + 4);
  EXPECT_EQ(std::system(
                absl::StrCat("promtool check metrics < ", path, " > ", path, ".out 2>&1").c_str()),
            0);
  EXPECT_EQ(std::filesystem::file_size(path + ".out"), 0);
}

TEST_F(MetricsTest, NamesThatClientsChooseAreNotOnThePage) {
  const auto client = Connect();
  EXPECT_FALSE(client->GetSession(absl::StrCat("sessions/", kPlanted)).ok());
  EXPECT_THAT(Page(),
              AllOf(Not(HasSubstr(kPlanted)),
                    HasSubstr("tissueform_failures_total{reason=\"SESSION_NOT_FOUND\"} 1")));
}

TEST_F(MetricsTest, WithoutTheOptionThereIsNoPage) {
  StartServer(TestOptions());
  EXPECT_EQ(server().metrics_port(), 0);
}

}  // namespace
}  // namespace tissueform::testing
