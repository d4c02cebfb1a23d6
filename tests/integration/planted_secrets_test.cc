// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <filesystem>
#include <memory>
#include <optional>
#include <sstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/client_context.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "spdlog/sinks/ostream_sink.h"
#include "spdlog/spdlog.h"

#include "server/platform/log_lines.h"
#include "tests/integration/service_test.h"
#include "tests/testing/http_get.h"
#include "tests/testing/journal_socket.h"
#include "tissueform/v1/case_service.grpc.pb.h"
#include "tissueform/v1/mesh_service.grpc.pb.h"
#include "tissueform/v1/prediction_service.grpc.pb.h"
#include "tissueform/v1/session_service.grpc.pb.h"

// Secrets and names of patients, wherever a client can put them, are neither in the log nor in the
// metrics nor in the audit of a server.
namespace tissueform::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kPlanted[] = "PLANTED-Erika-Mustermann";
constexpr char kRequestId[] = "request-7";
constexpr char kTraceparent[] = "00-0123456789abcdef0123456789abcdef-0123456789abcdef-01";

class PlantedSecretsTest : public ServiceTest {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    journal_.emplace(socket_);
    before_ = spdlog::default_logger();
    auto logger = std::make_shared<spdlog::logger>(
        "server", std::make_shared<spdlog::sinks::ostream_sink_mt>(log_));
    logger->set_formatter(MakeJsonLines());
    logger->set_level(spdlog::level::trace);
    spdlog::set_default_logger(logger);
    ServerOptions options = TestOptions();
    options.in_memory = false;
    options.data_dir = folder_ / "kept";
    options.telemetry.metrics_port = 0;
    options.telemetry.audit = {.target = "journal", .journal_socket = socket_};
    StartServer(options);
  }
  void TearDown() override { spdlog::set_default_logger(before_); }

  static void Plant(grpc::ClientContext* context) {
    context->AddMetadata("authorization", absl::StrCat("Bearer ", kPlanted));
    context->AddMetadata("x-patient", kPlanted);
    context->AddMetadata("x-request-id", kRequestId);
    context->AddMetadata("traceparent", kTraceparent);
  }

  template <typename Service, typename Request, typename Response>
  void Call(grpc::Status (Service::Stub::*method)(grpc::ClientContext*, const Request&, Response*),
            const Request& request) {
    const auto stub = Service::NewStub(OwnChannel());
    grpc::ClientContext context;
    Plant(&context);
    Response response;
    (stub.get()->*method)(&context, request, &response);
  }

  void SendCase() {
    const auto stub = v1::CaseService::NewStub(OwnChannel());
    grpc::ClientContext context;
    Plant(&context);
    v1::UploadCaseResponse response;
    const auto writer = stub->UploadCase(&context, &response);
    v1::UploadCaseRequest request;
    request.mutable_header()->set_title(kPlanted);
    request.mutable_header()->set_sha256(std::string(64, 'a'));
    request.mutable_header()->set_total_bytes(10);
    writer->Write(request);
    request.mutable_chunk()->set_data(kPlanted);
    writer->Write(request);
    writer->WritesDone();
    writer->Finish();
  }

  // All events so far.
  const std::string& Audit() {
    for (const std::string& message : journal_->Messages()) audit_ += message + "\n";
    return audit_;
  }

  const fs::path folder_ =
      fs::path(::testing::TempDir()) /
      absl::StrCat("planted_secrets_",
                   ::testing::UnitTest::GetInstance()->current_test_info()->name());
  const std::string socket_ = NewSocketPath();
  std::optional<JournalSocket> journal_;
  std::string audit_;
  std::ostringstream log_;
  std::shared_ptr<spdlog::logger> before_;
};

TEST_F(PlantedSecretsTest, DoNotAppearInLogMetricsOrAudit) {
  const BarProblem problem(1);
  const auto client = Connect();
  const v1::Session session = MakeSession(client.get(), problem);
  v1::CreatePredictionRequest prediction;
  prediction.set_session(session.name());
  prediction.set_title(kPlanted);
  Call<v1::PredictionService>(&v1::PredictionService::Stub::CreatePrediction, prediction);
  v1::GetSessionRequest unknown;
  unknown.set_name(absl::StrCat("sessions/", kPlanted));
  Call<v1::SessionService>(&v1::SessionService::Stub::GetSession, unknown);
  v1::GetMeshRequest mesh;
  mesh.set_name(kPlanted);
  Call<v1::MeshService>(&v1::MeshService::Stub::GetMesh, mesh);
  SendCase();
  // As much as there will be: the stream of the case is the last.
  ASSERT_TRUE(Eventually([this] {
    const std::string& audit = Audit();
    return audit.find("CaseService.UploadCase", audit.find("\"close\"")) != std::string::npos;
  }));
  EXPECT_THAT(Audit(), Not(HasSubstr("PLANTED")));
  EXPECT_THAT(HttpGet(server().metrics_port(), "/metrics"), Not(HasSubstr("PLANTED")));
  EXPECT_THAT(log_.str(), Not(HasSubstr("PLANTED")));

  // They would be seen: the values that may be logged are there.
  EXPECT_THAT(Audit(), HasSubstr("\"rpc\":\"PredictionService.CreatePrediction\""));
  EXPECT_THAT(log_.str(), HasSubstr(absl::StrCat("\"traceparent\":\"", kTraceparent, "\"")));
  EXPECT_THAT(log_.str(), HasSubstr(absl::StrCat("\"request_id\":\"", kRequestId, "\"")));
  std::istringstream lines(log_.str());
  for (std::string line; std::getline(lines, line);) {
    EXPECT_TRUE(nlohmann::json::accept(line)) << line;
  }
}

}  // namespace
}  // namespace tissueform::testing
