// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cstdlib>
#include <string>

#include "grpcpp/support/slice.h"

#include "client/gateway/call_metadata.h"
#include "client/gateway/method_table.h"
#include "client/gateway/socket_frames.h"
#include "client/gateway/web_frames.h"
#include "tests/fuzz/byte_source.h"
#include "tests/fuzz/fuzz_target.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform::fuzz {
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

// What gRPC would end the process for.
void RequireSendable(const CallStart& start) {
  Require(IsServedMethod(start.method));
  for (const auto& [name, value] : start.metadata) {
    Require(MayBeSent(name));
    for (const char c : value) Require(c >= ' ' && c <= '~');
  }
  Require(!start.timeout.has_value() || start.timeout->count() > 0);
}

// Of what a server answers, whose bytes may be any as well.
void RequirePlace(absl::string_view message, const google::protobuf::Descriptor& type) {
  const grpc::Slice slice{std::string(message)};
  const auto frame = MessageFrame(grpc::ByteBuffer(&slice, 1), &type);
  Require(frame.ok());
  const auto number = [&](size_t at) {
    return ByteSource(reinterpret_cast<const uint8_t*>(frame->data()) + at, 4).Take<uint32_t>();
  };
  const auto payload_at = static_cast<uint8_t>((*frame)[2]);
  Require(payload_at >= 32 && payload_at <= 35 && frame->substr(payload_at) == message);
  Require(number(8) % 4 == 0 && uint64_t{number(8)} + number(12) <= frame->size());
}

}  // namespace

void FuzzSocketFrame(const uint8_t* data, size_t size) {
  const absl::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto frame = ParseClientFrame(bytes);
  if (frame.ok()) Require(frame->payload.size() + kSocketFrameHeadBytes == size);
  const auto start = ParseStart(frame.ok() ? frame->payload : bytes);
  if (start.ok()) RequireSendable(*start);
  RequirePlace(bytes, *v1::DeformResponse::descriptor());
  RequirePlace(bytes, *v1::WatchResponse::descriptor());
}

void FuzzWebRequest(const uint8_t* data, size_t size) {
  ByteSource source(data, size);
  HttpHead head = {.method = "POST",
                   .target = std::string(source.TakeBytes(source.Take<uint8_t>()))};
  for (const char* name : {"authorization", "x-tissueform-session", "cookie"}) {
    head.fields.emplace_back(name, source.TakeBytes(source.Take<uint8_t>()));
  }
  const absl::string_view timeout = source.TakeBytes(source.Take<uint8_t>());
  const absl::string_view body = source.TakeBytes(source.left());
  CallStart start = {.method = std::string(head.Path()), .metadata = MetadataOf(head)};
  if (IsServedMethod(start.method) && CheckMetadata(start.metadata).ok()) RequireSendable(start);
  static_cast<void>(KindOf(start.method));
  if (const auto parsed = ParseGrpcTimeout(timeout); parsed.ok()) Require(parsed->count() >= 0);
  if (const auto message = ParseWebRequest(body); message.ok()) {
    Require(WebMessageFrame(*message) == body);
  }
  for (const auto& field : WebEndFields(
           {.status = grpc::Status(grpc::StatusCode::UNKNOWN, std::string(body), std::string(body)),
          .trailers = {}})) {
    for (const char c : field.second) Require(c >= ' ' && c <= '~');
  }
}

}  // namespace tissueform::fuzz
