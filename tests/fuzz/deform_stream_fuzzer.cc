// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "grpcpp/impl/codegen/proto_utils.h"

#include "server/rpc/calls/status_conversion.h"
#include "server/rpc/watch_stream.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/rpc_rig.h"

namespace tissueform::fuzz {
namespace {

using Stream = testing::FakeBidiCall<v1::DeformRequest, v1::DeformResponse>;

// Inputs stay short: what a long one finds a shorter one finds as well.
constexpr int kMaxActions = 64;
constexpr size_t kMaxWatches = 3;
// In a fuzzer's message it stands for the name that the server has chosen.
constexpr char kOwnWatch[] = "watches/own";

// A drag, which ends at the latest with this object.
class Drag {
 public:
  explicit Drag(RpcRig* rig) : call_(&rig->reactions) { call_.Bind(rig->service.Deform(nullptr)); }
  ~Drag() {
    call_.CloseSending();
    while (const auto response = call_.Receive()) Check(*response);
    CheckEnd(call_.WaitUntilDone());
  }
  Drag(const Drag&) = delete;
  Drag& operator=(const Drag&) = delete;

  void Send(const v1::DeformRequest& request) {
    if (request.has_configuration() && !encoding_.has_value()) {
      encoding_ = request.configuration().encoding();
    }
    call_.Send(request);
  }
  void Cancel() { call_.Cancel(); }

 private:
  void Check(const v1::DeformResponse& response) const {
    CheckFinite(response);
    if (response.has_frame()) {
      CheckPositions(response.frame().positions(), encoding_.value_or(v1::PositionEncoding()));
    }
  }

  Stream call_;
  std::optional<v1::PositionEncoding> encoding_;
};

// A watch, which ends at the latest with this object.
class Watch {
 public:
  Watch(RpcRig* rig, absl::string_view request)
      : request_(ToBuffer(request)), call_(&rig->reactions) {
    call_.Bind(rig->service.Watch(nullptr, &request_));
    // Either it begins, or it ends.
    if (const auto first = Receive(); first.has_value()) name_ = first->started().watch();
  }
  ~Watch() {
    call_.Cancel();
    while (Receive().has_value()) continue;
    CheckEnd(call_.WaitUntilDone());
  }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  // Empty where it did not begin.
  const std::string& name() const { return name_; }

 private:
  static grpc::ByteBuffer ToBuffer(absl::string_view bytes) {
    const grpc::Slice slice(bytes.data(), bytes.size());
    return {&slice, 1};
  }

  std::optional<v1::WatchResponse> Receive() {
    std::optional<grpc::ByteBuffer> bytes = call_.Receive();
    if (!bytes.has_value()) return std::nullopt;
    v1::WatchResponse response;
    if (!grpc::SerializationTraits<v1::WatchResponse>::Deserialize(&*bytes, &response).ok()) {
      std::abort();
    }
    CheckFinite(response);
    if (response.has_started()) encoding_ = response.started().form().encoding();
    if (response.has_form()) encoding_ = response.form().encoding();
    if (response.has_frame()) CheckPositions(response.frame().frame().positions(), encoding_);
    return response;
  }

  const grpc::ByteBuffer request_;
  testing::FakeWriterCall<grpc::ByteBuffer> call_;
  std::string name_;
  v1::PositionEncoding encoding_ = v1::POSITION_ENCODING_UNSPECIFIED;
};

// As the service does, whose unary calls need gRPC's own context.
void Acknowledge(RpcRig* rig, v1::AcknowledgeWatchRequest request, const Watch* watch) {
  if (watch != nullptr && request.watch() == kOwnWatch) request.set_watch(watch->name());
  const absl::StatusOr<std::string> id = ParseWatchName(request.watch());
  CheckEnd(ToGrpcStatus(id.ok() ? rig->watches.Acknowledge(*id, request.number()) : id.status()));
}

// What one input does to the server.
class Play {
 public:
  explicit Play(RpcRig* rig) : rig_(rig), drag_(std::make_unique<Drag>(rig)) {}

  void Act(int action, absl::string_view bytes) {
    switch (action) {
      case 0:
        watches_.push_back(std::make_unique<Watch>(rig_, bytes));
        if (watches_.size() > kMaxWatches) watches_.erase(watches_.begin());
        break;
      case 1:
        if (v1::AcknowledgeWatchRequest request;
            request.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
          Acknowledge(rig_, request, watches_.empty() ? nullptr : watches_.back().get());
        }
        break;
      case 2:
        rig_->clock.Advance(2 * SessionTable::kInUse);
        rig_->registry.table().Evict([] { return false; });
        break;
      case 3:
        drag_.reset();
        drag_ = std::make_unique<Drag>(rig_);
        break;
      case 4:
        drag_->Cancel();
        break;
      case 5:
        rig_->streams.NotifyDraining(std::chrono::system_clock::now());
        break;
      default:
        if (v1::DeformRequest request;
            request.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
          drag_->Send(request);
        }
    }
  }

 private:
  RpcRig* const rig_;
  std::vector<std::unique_ptr<Watch>> watches_;
  std::unique_ptr<Drag> drag_;
};

}  // namespace

void FuzzDeformStream(const uint8_t* data, size_t size) {
  // One for all inputs, which leave nothing in it but what clients may leave. It lives as long as
  // the program: its threads must not meet the ends of other static objects.
  static auto* const rig = new RpcRig();
  ByteSource source(data, size);
  Play play(rig);
  for (int i = 0; i < kMaxActions && source.left() > 0; ++i) {
    const int action = source.Take<uint8_t>() % 16;
    const size_t count = source.Take<uint16_t>();
    play.Act(action, source.TakeBytes(count));
  }
}

}  // namespace tissueform::fuzz
