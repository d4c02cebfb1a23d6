// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/labels/label_reader_call.h"

#include <filesystem>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/process/helper_call.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kWhat[] = "reading the label map";
constexpr int64_t kMaxRules = 10000;
constexpr int64_t kMaxNotes = 1000;
constexpr int64_t kMaxOtherBytes = int64_t{1} << 26;  // everything but the voxels
constexpr int64_t kNoValue = 0;                       // otherwise the value plus one

void SendRequest(const std::string& path, const LabelReadOptions& options, PipeSender* sender) {
  sender->Text(path);
  sender->Number(static_cast<int64_t>(options.names.size()));
  for (const LabelRule& rule : options.names) {
    sender->Number(static_cast<int64_t>(rule.structure));
    sender->Text(rule.name);
    sender->Number(rule.value ? int64_t{*rule.value} + 1 : kNoValue);
  }
  sender->Text(options.convention);
  sender->Text(options.axes);
  static_assert(std::is_trivially_copyable_v<LabelLimits>);
  sender->Bytes(&options.limits, sizeof(options.limits));
}

absl::StatusOr<LabelRule> ReceiveRule(PipeReceiver* receiver) {
  LabelRule rule;
  TF_ASSIGN_OR_RETURN(const int64_t structure, receiver->Number(kNumStructures - 1));
  rule.structure = static_cast<Structure>(structure);
  TF_ASSIGN_OR_RETURN(rule.name, receiver->Text());
  TF_ASSIGN_OR_RETURN(const int64_t value, receiver->Number(INT32_MAX));
  if (value != kNoValue) rule.value = static_cast<int>(value - 1);
  return rule;
}

struct LabelReadRequest {
  std::string path;
  LabelReadOptions options;
};

absl::StatusOr<LabelReadRequest> ReceiveRequest(PipeReceiver* receiver) {
  LabelReadRequest request;
  TF_ASSIGN_OR_RETURN(request.path, receiver->Text());
  TF_ASSIGN_OR_RETURN(const int64_t num_rules, receiver->Number(kMaxRules));
  for (int64_t i = 0; i < num_rules; ++i) {
    TF_ASSIGN_OR_RETURN(LabelRule rule, ReceiveRule(receiver));
    request.options.names.push_back(std::move(rule));
  }
  TF_ASSIGN_OR_RETURN(request.options.convention, receiver->Text());
  TF_ASSIGN_OR_RETURN(request.options.axes, receiver->Text());
  TF_RETURN_IF_ERROR(receiver->Bytes(&request.options.limits, sizeof(request.options.limits)));
  return request;
}

void SendSegment(const LabelSegment& segment, PipeSender* sender) {
  sender->Text(segment.name);
  sender->Number(segment.layer);
  sender->Number(segment.value);
  sender->Number(segment.structure ? static_cast<int64_t>(*segment.structure) + 1 : 0);
  sender->Number(static_cast<int64_t>(segment.side));
  sender->Number(segment.voxels);
  sender->Bytes(segment.middle_mm.data(), sizeof(segment.middle_mm));
}

absl::StatusOr<LabelSegment> ReceiveSegment(PipeReceiver* receiver) {
  LabelSegment segment;
  TF_ASSIGN_OR_RETURN(segment.name, receiver->Text());
  TF_ASSIGN_OR_RETURN(const int64_t layer, receiver->Number(INT32_MAX));
  TF_ASSIGN_OR_RETURN(const int64_t value, receiver->Number(INT32_MAX));
  TF_ASSIGN_OR_RETURN(const int64_t structure, receiver->Number(kNumStructures));
  TF_ASSIGN_OR_RETURN(const int64_t side, receiver->Number(2));
  TF_ASSIGN_OR_RETURN(segment.voxels, receiver->Number(INT64_MAX));
  segment.layer = static_cast<int>(layer);
  segment.value = static_cast<int>(value);
  if (structure != 0) segment.structure = static_cast<Structure>(structure - 1);
  segment.side = static_cast<Side>(side);
  TF_RETURN_IF_ERROR(receiver->Bytes(segment.middle_mm.data(), sizeof(segment.middle_mm)));
  return segment;
}

void SendMap(const absl::StatusOr<LabelMap>& map, PipeSender* sender) {
  sender->Outcome(map.status());
  if (!map.ok()) return;
  for (const int size : map->size) sender->Number(size);
  sender->Bytes(map->origin_mm.data(), sizeof(map->origin_mm));
  sender->Bytes(map->steps_mm.data(), sizeof(map->steps_mm));
  for (const std::string* text : {&map->format, &map->sha256, &map->frame_uid}) {
    sender->Text(*text);
  }
  sender->Number(static_cast<int64_t>(map->segments.size()));
  for (const LabelSegment& segment : map->segments) SendSegment(segment, sender);
  sender->Number(static_cast<int64_t>(map->notes.size()));
  for (const std::string& note : map->notes) sender->Text(note);
  sender->Bytes(map->structures.data(), map->structures.size() * sizeof(StructureSet));
}

absl::Status ReceiveSize(PipeReceiver* receiver, int64_t max_voxels, LabelMap* map) {
  int64_t voxels_left = max_voxels;
  for (int& size : map->size) {
    TF_ASSIGN_OR_RETURN(const int64_t number, receiver->Number(INT32_MAX));
    if (number < 1 || number > voxels_left) return PipeReceiver::BrokenOff();
    voxels_left /= number;
    size = static_cast<int>(number);
  }
  return absl::OkStatus();
}

absl::StatusOr<LabelMap> ReceiveMap(int descriptor, const LabelLimits& limits) {
  PipeReceiver receiver(descriptor, kMaxOtherBytes);
  TF_RETURN_IF_ERROR(receiver.Outcome());
  LabelMap map;
  TF_RETURN_IF_ERROR(ReceiveSize(&receiver, limits.max_voxels, &map));
  TF_RETURN_IF_ERROR(receiver.Bytes(map.origin_mm.data(), sizeof(map.origin_mm)));
  TF_RETURN_IF_ERROR(receiver.Bytes(map.steps_mm.data(), sizeof(map.steps_mm)));
  for (std::string* text : {&map.format, &map.sha256, &map.frame_uid}) {
    TF_ASSIGN_OR_RETURN(*text, receiver.Text());
  }
  TF_ASSIGN_OR_RETURN(const int64_t num_segments, receiver.Number(limits.max_segments));
  for (int64_t i = 0; i < num_segments; ++i) {
    TF_ASSIGN_OR_RETURN(LabelSegment segment, ReceiveSegment(&receiver));
    map.segments.push_back(std::move(segment));
  }
  TF_ASSIGN_OR_RETURN(const int64_t num_notes, receiver.Number(kMaxNotes));
  for (int64_t i = 0; i < num_notes; ++i) {
    TF_ASSIGN_OR_RETURN(std::string note, receiver.Text());
    map.notes.push_back(std::move(note));
  }
  map.structures.resize(static_cast<size_t>(map.num_voxels()));
  TF_RETURN_IF_ERROR(
      receiver.Bytes(map.structures.data(), map.structures.size() * sizeof(StructureSet)));
  return map;
}

absl::Status CheckFile(const std::string& path, const LabelLimits& limits) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return absl::NotFoundError("there is no such file");
  if (std::filesystem::is_directory(path, error)) return absl::OkStatus();  // its files are checked
  if (!std::filesystem::is_regular_file(path, error)) {
    return absl::InvalidArgumentError(
        "it is not a file; name the file of the label map, or a folder of masks");
  }
  const auto bytes = static_cast<int64_t>(std::filesystem::file_size(path, error));
  if (error || bytes <= limits.max_file_bytes) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("the file has ", bytes, " bytes, more than max_file_bytes of label maps (",
                   limits.max_file_bytes, "); store it compressed, or with fewer voxels"));
}

absl::Status WithSubject(const absl::Status& status) {
  return {status.code(), absl::StrCat("cannot use the label map: ", status.message())};
}

}  // namespace

absl::StatusOr<LabelMap> CallLabelReader(const std::string& path, const LabelReadOptions& options) {
  const IsolationLimits isolation{options.limits.max_memory_bytes, options.limits.max_seconds};
  absl::StatusOr<LabelMap> map = absl::InternalError("not received");
  TF_RETURN_IF_ERROR(CallHelper(
      {kLabelReaderProgram, kWhat, isolation},
      [&](PipeSender* request) { SendRequest(path, options, request); },
      [&](int descriptor) {
        map = ReceiveMap(descriptor, options.limits);
        return map.status();
      }));
  return map;
}

int RunLabelReader(const LabelReadWork& read) {
  return RunHelperProgram(
      [&read](const IsolationLimits& limits, PipeReceiver* receiver, PipeSender* answer) {
        absl::StatusOr<LabelMap> map = absl::InternalError("not read");
        const absl::Status status = WithoutExceptions(kWhat, limits, [&]() -> absl::Status {
          TF_ASSIGN_OR_RETURN(const LabelReadRequest request, ReceiveRequest(receiver));
          map = read(request.path, request.options);
          return map.status();
        });
        SendMap(status.ok() ? map : status, answer);
      });
}

absl::StatusOr<LabelMap> ReadLabelMap(const std::string& path, const LabelReadOptions& options) {
  if (const absl::Status status = CheckFile(path, options.limits); !status.ok()) {
    return WithSubject(status);
  }
  absl::StatusOr<LabelMap> map = CallLabelReader(path, options);
  if (!map.ok()) return WithSubject(map.status());
  return map;
}

}  // namespace tissueform
