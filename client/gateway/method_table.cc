// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/method_table.h"

#include <algorithm>
#include <array>

#include "google/protobuf/io/coded_stream.h"
#include "google/protobuf/wire_format_lite.h"

#include "proto/services/service_list.h"

namespace tissueform {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::MethodDescriptor;
using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;

// Messages in messages: ours are four deep.
constexpr int kMaxDepth = 16;

constexpr std::array<absl::string_view, 7> kDownloads = {
    "tissueform.v1.MeshService.GetSurface",
    "tissueform.v1.CaseService.ReadCase",
    "tissueform.v1.PlanBuildService.ReadBuildDraft",
    "tissueform.v1.PlanBuildService.ReadPlanBuildFile",
    "tissueform.v1.PredictionService.ReadPositions",
    "tissueform.v1.PredictionService.ComparePredictions",
    "tissueform.v1.DeformService.GetPreparedAnswers"};

const MethodDescriptor* Find(absl::string_view method) {
  if (method.empty()) return nullptr;
  std::string name(method.substr(1));
  std::replace(name.begin(), name.end(), '/', '.');
  for (const google::protobuf::ServiceDescriptor* service : AllServices()) {
    for (int i = 0; i < service->method_count(); ++i) {
      if (service->method(i)->full_name() == name) return service->method(i);
    }
  }
  return nullptr;
}

// Of the message that ends at the stream's limit. False when the bytes are not such a message.
bool FindLongest(CodedInputStream* stream, const Descriptor& type, int depth, BytesPlace* longest) {
  while (const uint32_t tag = stream->ReadTag()) {
    const FieldDescriptor* field = type.FindFieldByNumber(WireFormatLite::GetTagFieldNumber(tag));
    const bool has_length =
        WireFormatLite::GetTagWireType(tag) == WireFormatLite::WIRETYPE_LENGTH_DELIMITED;
    if (!has_length || field == nullptr ||
        (field->type() != FieldDescriptor::TYPE_BYTES && field->message_type() == nullptr)) {
      if (!WireFormatLite::SkipField(stream, tag)) return false;
      continue;
    }
    uint32_t size = 0;
    if (!stream->ReadVarint32(&size)) return false;
    const auto begin = static_cast<uint32_t>(stream->CurrentPosition());
    if (field->message_type() != nullptr && depth < kMaxDepth) {
      const auto limit = stream->PushLimit(static_cast<int>(size));
      if (!FindLongest(stream, *field->message_type(), depth + 1, longest)) return false;
      stream->PopLimit(limit);
      continue;
    }
    if (!stream->Skip(static_cast<int>(size))) return false;
    if (field->type() == FieldDescriptor::TYPE_BYTES && size > longest->size) {
      *longest = {.offset = begin, .size = size};
    }
  }
  return stream->ConsumedEntireMessage();
}

}  // namespace

MethodKind KindOf(absl::string_view method) {
  if (method == "/grpc.health.v1.Health/Check") return MethodKind::kUnary;
  const MethodDescriptor* found = Find(method);
  if (found == nullptr || found->client_streaming()) return MethodKind::kLong;
  if (!found->server_streaming()) return MethodKind::kUnary;
  return std::find(kDownloads.begin(), kDownloads.end(), found->full_name()) != kDownloads.end()
             ? MethodKind::kDownload
             : MethodKind::kLong;
}

const Descriptor* AnswerOf(absl::string_view method) {
  const MethodDescriptor* found = Find(method);
  return found != nullptr ? found->output_type() : nullptr;
}

BytesPlace LongestBytes(absl::string_view message, const Descriptor& type) {
  CodedInputStream stream(reinterpret_cast<const uint8_t*>(message.data()),
                          static_cast<int>(message.size()));
  BytesPlace longest;
  if (!FindLongest(&stream, type, 0, &longest)) return {};
  return longest;
}

}  // namespace tissueform
