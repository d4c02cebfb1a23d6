// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/bare_transport.h"

#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include <grpcpp/grpcpp.h>

#include "tissueform/v1/deform_service.grpc.pb.h"

namespace tissueform {
namespace {

using SteadyClock = std::chrono::steady_clock;

// Answers pose by pose.
class BareStream : public grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse> {
 public:
  explicit BareStream(int64_t frame_bytes) : frame_bytes_(frame_bytes) { StartRead(&request_); }

  void OnReadDone(bool ok) override {
    if (!ok) {
      Finish(grpc::Status::OK);
      return;
    }
    // Built for every answer, as the positions of a frame are.
    response_.Clear();
    response_.mutable_frame()->set_sequence(request_.pose().sequence());
    response_.mutable_frame()->set_positions(std::string(static_cast<size_t>(frame_bytes_), 'x'));
    StartWrite(&response_);
  }
  void OnWriteDone(bool ok) override {
    if (ok) {
      StartRead(&request_);
    } else {
      Finish(grpc::Status::CANCELLED);
    }
  }
  void OnDone() override { delete this; }

 private:
  const int64_t frame_bytes_;
  v1::DeformRequest request_;
  v1::DeformResponse response_;
};

class BareService : public v1::DeformService::CallbackService {
 public:
  explicit BareService(int64_t frame_bytes) : frame_bytes_(frame_bytes) {}

  grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse>* Deform(
      grpc::CallbackServerContext* /*context*/) override {
    return new BareStream(frame_bytes_);
  }

 private:
  const int64_t frame_bytes_;
};

}  // namespace

absl::StatusOr<std::vector<double>> MeasureBareTransport(int64_t frame_bytes,
                                                         double poses_per_second, double seconds) {
  BareService service(frame_bytes);
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&service);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  if (server == nullptr || port == 0) {
    return absl::UnavailableError("127.0.0.1 has no free port for the bare server");
  }
  const auto stub = v1::DeformService::NewStub(
      grpc::CreateChannel(absl::StrCat("127.0.0.1:", port), grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  const auto stream = stub->Deform(&context);
  const auto interval = std::chrono::duration_cast<SteadyClock::duration>(
      std::chrono::duration<double>(1 / poses_per_second));
  const SteadyClock::time_point start = SteadyClock::now();
  std::vector<double> latencies_ms;
  v1::DeformRequest request;
  v1::DeformResponse response;
  for (int64_t i = 0; (interval * i) < std::chrono::duration<double>(seconds); ++i) {
    std::this_thread::sleep_until(start + interval * i);
    request.mutable_pose()->set_sequence(static_cast<uint64_t>(i));
    const SteadyClock::time_point sent = SteadyClock::now();
    if (!stream->Write(request) || !stream->Read(&response)) {
      return absl::UnavailableError("the bare server's stream ended early");
    }
    latencies_ms.push_back(
        std::chrono::duration<double, std::milli>(SteadyClock::now() - sent).count());
  }
  stream->WritesDone();
  if (const grpc::Status status = stream->Finish(); !status.ok()) {
    return absl::UnavailableError(status.error_message());
  }
  server->Shutdown();
  return latencies_ms;
}

}  // namespace tissueform
