// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/fuzz/rpc_rig.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <future>
#include <utility>
#include <vector>

#include "google/protobuf/stubs/logging.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "core/mechanics/linear_solvers/blas_threads.h"
#include "tests/testing/meshes.h"
#include "tests/testing/session_samples.h"

namespace tissueform::fuzz {
namespace {

constexpr size_t kVertexBytes = 3 * sizeof(float);

void Require(bool condition, const std::string& what = "a promise of DeformService is broken") {
  if (condition) return;
  std::fprintf(stderr, "%s\n", what.c_str());
  std::abort();
}

bool IsPublished(const std::string& reason) {
  const auto names = AllReasonNames();
  return std::find(names.begin(), names.end(), reason) != names.end();
}

// Of field `field`, element `i` where it is repeated.
double NumberIn(const google::protobuf::Message& message,
                const google::protobuf::FieldDescriptor& field, int i) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  switch (field.cpp_type()) {
    case google::protobuf::FieldDescriptor::CPPTYPE_DOUBLE:
      return field.is_repeated() ? reflection.GetRepeatedDouble(message, &field, i)
                                 : reflection.GetDouble(message, &field);
    case google::protobuf::FieldDescriptor::CPPTYPE_FLOAT:
      return field.is_repeated() ? reflection.GetRepeatedFloat(message, &field, i)
                                 : reflection.GetFloat(message, &field);
    default:
      return 0;
  }
}

}  // namespace

RpcRig::RpcRig() {
  SetBlasThreads(1);
  spdlog::set_level(spdlog::level::off);
  google::protobuf::SetLogHandler(nullptr);  // one line for every name that is no UTF-8
  registry.table().set_observer(
      [this](const std::string& id, SessionEvent event) { watches.OnSessionEvent(id, event); });
  auto bar = testing::Store(testing::SampleMesh(testing::Bar({1, 1, 2})), &catalog);
  SessionRecord record = testing::BarRecord(*bar);
  record.id = "fuzzed";
  std::promise<bool> made;
  registry.loader().Create(std::move(record), bar, std::make_shared<std::atomic<bool>>(),
                           [&made](const absl::StatusOr<std::shared_ptr<Session>>& session) {
                             made.set_value(session.ok());
                           });
  Require(made.get_future().get());
}

void CheckEnd(const std::optional<grpc::Status>& status) {
  Require(status.has_value());
  switch (status->error_code()) {
    case grpc::StatusCode::OK:
    case grpc::StatusCode::CANCELLED:  // by the client, which receives nothing more
      return;
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::NOT_FOUND:
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
    case grpc::StatusCode::ABORTED:
    case grpc::StatusCode::UNAVAILABLE:
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      break;
    default:
      std::abort();
  }
  google::rpc::Status details;
  Require(details.ParseFromString(status->error_details()) && details.details_size() == 1);
  google::rpc::ErrorInfo info;
  Require(details.details(0).UnpackTo(&info) && IsPublished(info.reason()));
  Require(!status->error_message().empty());
}

void CheckFinite(const google::protobuf::Message& message) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const google::protobuf::FieldDescriptor* field : fields) {
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    const bool is_message = field->cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE;
    for (int i = 0; i < count; ++i) {
      if (!is_message) {
        Require(std::isfinite(NumberIn(message, *field, i)), message.DebugString());
      } else if (field->is_repeated()) {
        CheckFinite(reflection.GetRepeatedMessage(message, field, i));
      } else {
        CheckFinite(reflection.GetMessage(message, field));
      }
    }
  }
}

void CheckPositions(const std::string& bytes, v1::PositionEncoding encoding) {
  if (encoding == v1::POSITION_ENCODING_INT16_ZSTD) return;  // integers, times a step
  Require(bytes.size() % kVertexBytes == 0);
  for (size_t i = 0; i < bytes.size(); i += sizeof(float)) {
    float number = 0;
    std::memcpy(&number, bytes.data() + i, sizeof(number));
    Require(std::isfinite(number));
  }
}

}  // namespace tissueform::fuzz
