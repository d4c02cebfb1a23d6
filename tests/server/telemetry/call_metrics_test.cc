// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/call_metrics.h"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "server/telemetry/rpc_table.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::IsOk;
using ::testing::Not;

class CallMetricsTest : public ::testing::Test {
 protected:
  CallMetricsTest() { metrics_.AddTo(&page_); }

  // A call with everything that a client chooses.
  void Call(const std::string& method, const absl::Status& outcome, bool served = true) {
    const Principal planted{.name = "PLANTED"};
    const ObservedCall call{.method = method,
                            .kind = CallKind::kNewWork,
                            .principal = planted,
                            .resource = "sessions/PLANTED",
                            .address = "PLANTED",
                            .request_id = "PLANTED",
                            .traceparent = "PLANTED",
                            .served = served};
    if (served) {
      EXPECT_THAT(metrics_.OnBegin(call), IsOk());
    }
    metrics_.OnResource(call);
    metrics_.OnEnd(call, outcome, std::chrono::milliseconds(2));
  }

  CallMetrics metrics_;
  MetricsPage page_;
};

TEST_F(CallMetricsTest, CountsByRpcAndCode) {
  Call("MeshService.GetMesh", absl::OkStatus());
  Call("MeshService.GetMesh", absl::OkStatus());
  Call("MeshService.GetMesh", absl::NotFoundError("gone"));
  EXPECT_THAT(
      page_.Text(),
      AllOf(HasSubstr("tissueform_calls_total{code=\"OK\",rpc=\"MeshService.GetMesh\"} 2\n"),
            HasSubstr("{code=\"NOT_FOUND\",rpc=\"MeshService.GetMesh\"} 1\n"),
            HasSubstr("seconds_bucket{rpc=\"MeshService.GetMesh\",le=\"0.0025\"} 3\n"),
            HasSubstr("seconds_bucket{rpc=\"MeshService.GetMesh\",le=\"0.001\"} 0\n"),
            HasSubstr("tissueform_failures_total{reason=\"NOT_FOUND\"} 1\n")));
}

TEST_F(CallMetricsTest, ACallIsOpenUntilItEnds) {
  const Principal nobody = {};
  const ObservedCall call{.method = "DeformService.Deform",
                          .kind = CallKind::kNewWork,
                          .principal = nobody,
                          .resource = "",
                          .address = "",
                          .request_id = "",
                          .traceparent = "",
                          .served = true};
  EXPECT_THAT(metrics_.OnBegin(call), IsOk());
  EXPECT_THAT(page_.Text(), HasSubstr("tissueform_calls_open{rpc=\"DeformService.Deform\"} 1\n"));
  metrics_.OnEnd(call, absl::OkStatus(), {});
  EXPECT_THAT(page_.Text(), HasSubstr("tissueform_calls_open{rpc=\"DeformService.Deform\"} 0\n"));
}

TEST_F(CallMetricsTest, CountsUnauthenticatedCallsByReasonAndNotAsOpen) {
  Call("MeshService.GetMesh", absl::UnauthenticatedError("no token"), /*served=*/false);
  EXPECT_THAT(
      page_.Text(),
      AllOf(HasSubstr("tissueform_authentication_failures_total{reason=\"UNAUTHENTICATED\"} 1\n"),
            HasSubstr("tissueform_calls_open{rpc=\"MeshService.GetMesh\"} 0\n")));
}

TEST_F(CallMetricsTest, NothingThatAClientChoosesIsOnThePage) {
  Call("PLANTED.Method", WithErrorInfo(absl::InternalError("PLANTED"), {"PLANTED", {}}));
  EXPECT_THAT(page_.Text(),
              AllOf(Not(HasSubstr("PLANTED")),
                    HasSubstr("tissueform_calls_total{code=\"INTERNAL\",rpc=\"other\"} 1\n"),
                    HasSubstr("tissueform_failures_total{reason=\"other\"} 1\n")));
}

TEST(RpcTableTest, HasEveryServiceOfTheProtocol) {
  std::set<std::string> in_files;
  for (const auto& entry :
       std::filesystem::directory_iterator(testing::SourcePath("proto/tissueform/v1"))) {
    std::ifstream file(entry.path());
    const std::regex service("^service (\\w+) \\{");
    for (std::string line; std::getline(file, line);) {
      std::smatch match;
      if (std::regex_search(line, match, service)) in_files.insert(match[1]);
    }
  }
  std::set<std::string> in_table;
  for (const Rpc& rpc : AllRpcs()) in_table.insert(rpc.name.substr(0, rpc.name.find('.')));
  EXPECT_EQ(in_table, in_files);
}

}  // namespace
}  // namespace tissueform
