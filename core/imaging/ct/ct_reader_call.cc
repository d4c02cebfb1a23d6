// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/ct/ct_reader_call.h"

#include <optional>
#include <type_traits>
#include <utility>

#include "core/base/process/helper_call.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kWhat[] = "reading the CT";
constexpr int64_t kMaxNotes = 1000;
constexpr int64_t kMaxOtherBytes = int64_t{1} << 26;  // everything but the voxels

void SendProvenance(const CtProvenance& provenance, PipeSender* sender) {
  sender->Text(provenance.format);
  sender->Number(provenance.num_files);
  sender->Text(provenance.sha256);
  sender->Bytes(&provenance.gantry_tilt_deg, sizeof(provenance.gantry_tilt_deg));
  sender->Number(static_cast<int64_t>(provenance.notes.size()));
  for (const std::string& note : provenance.notes) sender->Text(note);
}

absl::Status ReceiveProvenance(PipeReceiver* receiver, CtProvenance* provenance) {
  TF_ASSIGN_OR_RETURN(provenance->format, receiver->Text());
  TF_ASSIGN_OR_RETURN(const int64_t num_files, receiver->Number(INT32_MAX));
  provenance->num_files = static_cast<int>(num_files);
  TF_ASSIGN_OR_RETURN(provenance->sha256, receiver->Text());
  TF_RETURN_IF_ERROR(
      receiver->Bytes(&provenance->gantry_tilt_deg, sizeof(provenance->gantry_tilt_deg)));
  TF_ASSIGN_OR_RETURN(const int64_t num_notes, receiver->Number(kMaxNotes));
  for (int64_t i = 0; i < num_notes; ++i) {
    TF_ASSIGN_OR_RETURN(std::string note, receiver->Text());
    provenance->notes.push_back(std::move(note));
  }
  return absl::OkStatus();
}

absl::Status ReceiveSize(PipeReceiver* receiver, int64_t max_voxels, CtVolume* volume) {
  int64_t voxels_left = max_voxels;
  for (int& size : volume->size) {
    TF_ASSIGN_OR_RETURN(const int64_t number, receiver->Number(INT32_MAX));
    if (number < 1) return PipeReceiver::BrokenOff();
    if (number > voxels_left) return absl::ResourceExhaustedError("it has too many voxels");
    voxels_left /= number;
    size = static_cast<int>(number);
  }
  return absl::OkStatus();
}

absl::Status ReceiveSliceOrigins(PipeReceiver* receiver, CtVolume* volume) {
  TF_ASSIGN_OR_RETURN(const int64_t count, receiver->Number(volume->size[2]));
  if (count != 0 && count != volume->size[2]) return PipeReceiver::BrokenOff();
  volume->slice_origins_mm.resize(static_cast<size_t>(count));
  for (Eigen::Vector3d& origin : volume->slice_origins_mm) {
    TF_RETURN_IF_ERROR(receiver->Bytes(origin.data(), sizeof(origin)));
  }
  return absl::OkStatus();
}

void SendVolume(const absl::StatusOr<CtVolume>& volume, PipeSender* sender) {
  sender->Outcome(volume.status());
  if (!volume.ok()) return;
  for (const int size : volume->size) sender->Number(size);
  sender->Bytes(volume->spacing_mm.data(), sizeof(volume->spacing_mm));
  sender->Bytes(volume->origin_mm.data(), sizeof(volume->origin_mm));
  sender->Bytes(volume->direction.data(), sizeof(volume->direction));
  sender->Number(static_cast<int64_t>(volume->slice_origins_mm.size()));
  for (const Eigen::Vector3d& origin : volume->slice_origins_mm) {
    sender->Bytes(origin.data(), sizeof(origin));
  }
  sender->Text(volume->frame_uid);
  sender->Number(volume->has_gray_values ? 1 : 0);
  SendProvenance(volume->provenance, sender);
  sender->Bytes(volume->hu.data(), volume->hu.size() * sizeof(int16_t));
}

absl::StatusOr<CtVolume> ReceiveVolume(int descriptor, int64_t max_voxels) {
  constexpr auto kVoxelBytes = static_cast<int64_t>(sizeof(int16_t));
  PipeReceiver receiver(descriptor, kMaxOtherBytes);
  TF_RETURN_IF_ERROR(receiver.Outcome());
  CtVolume volume;
  TF_RETURN_IF_ERROR(ReceiveSize(&receiver, max_voxels, &volume));
  TF_RETURN_IF_ERROR(receiver.Bytes(volume.spacing_mm.data(), sizeof(volume.spacing_mm)));
  TF_RETURN_IF_ERROR(receiver.Bytes(volume.origin_mm.data(), sizeof(volume.origin_mm)));
  TF_RETURN_IF_ERROR(receiver.Bytes(volume.direction.data(), sizeof(volume.direction)));
  TF_RETURN_IF_ERROR(ReceiveSliceOrigins(&receiver, &volume));
  TF_ASSIGN_OR_RETURN(volume.frame_uid, receiver.Text());
  TF_ASSIGN_OR_RETURN(const int64_t is_gray, receiver.Number(1));
  volume.has_gray_values = is_gray != 0;
  TF_RETURN_IF_ERROR(ReceiveProvenance(&receiver, &volume.provenance));
  volume.hu.resize(static_cast<size_t>(volume.num_voxels()));
  TF_RETURN_IF_ERROR(receiver.Bytes(volume.hu.data(), volume.hu.size() * kVoxelBytes));
  return volume;
}

template <typename T>
void SendOptional(const std::optional<T>& value, PipeSender* sender) {
  sender->Number(value ? 1 : 0);
  if (value) sender->Bytes(&*value, sizeof(T));
}

template <typename T>
absl::Status ReceiveOptional(PipeReceiver* receiver, std::optional<T>* value) {
  TF_ASSIGN_OR_RETURN(const int64_t is_there, receiver->Number(1));
  if (is_there == 0) return absl::OkStatus();
  return receiver->Bytes(&value->emplace(), sizeof(T));
}

void SendRequest(const std::string& path, const CtReadOptions& options, PipeSender* sender) {
  sender->Text(path);
  SendOptional(options.hu_offset, sender);
  sender->Text(options.axes);
  SendOptional(options.series_number, sender);
  sender->Number(static_cast<int64_t>(options.join_series));
  sender->Number(static_cast<int64_t>(options.values));
  sender->Bytes(&options.limits, sizeof(options.limits));
}

struct CtReadRequest {
  std::string path;
  CtReadOptions options;
};

absl::StatusOr<CtReadRequest> ReceiveRequest(PipeReceiver* receiver) {
  CtReadRequest request;
  TF_ASSIGN_OR_RETURN(request.path, receiver->Text());
  TF_RETURN_IF_ERROR(ReceiveOptional(receiver, &request.options.hu_offset));
  TF_ASSIGN_OR_RETURN(request.options.axes, receiver->Text());
  TF_RETURN_IF_ERROR(ReceiveOptional(receiver, &request.options.series_number));
  TF_ASSIGN_OR_RETURN(const int64_t join, receiver->Number(2));
  request.options.join_series = static_cast<JoinSeries>(join);
  TF_ASSIGN_OR_RETURN(const int64_t values, receiver->Number(2));
  request.options.values = static_cast<CtValues>(values);
  static_assert(std::is_trivially_copyable_v<CtReadLimits>);
  TF_RETURN_IF_ERROR(receiver->Bytes(&request.options.limits, sizeof(request.options.limits)));
  return request;
}

}  // namespace

absl::StatusOr<CtVolume> CallCtReader(const std::string& path, const CtReadOptions& options) {
  const IsolationLimits isolation{options.limits.max_memory_bytes, options.limits.max_seconds};
  absl::StatusOr<CtVolume> volume = absl::InternalError("not received");
  TF_RETURN_IF_ERROR(CallHelper(
      {kCtReaderProgram, kWhat, isolation},
      [&](PipeSender* request) { SendRequest(path, options, request); },
      [&](int descriptor) {
        volume = ReceiveVolume(descriptor, options.limits.max_voxels);
        return volume.status();
      }));
  return volume;
}

int RunCtReader(const std::function<absl::StatusOr<CtVolume>(const std::string& path,
                                                             const CtReadOptions& options)>& read) {
  return RunHelperProgram(
      [&read](const IsolationLimits& limits, PipeReceiver* receiver, PipeSender* answer) {
        absl::StatusOr<CtVolume> volume = absl::InternalError("not read");
        const absl::Status status = WithoutExceptions(kWhat, limits, [&]() -> absl::Status {
          TF_ASSIGN_OR_RETURN(const CtReadRequest request, ReceiveRequest(receiver));
          volume = read(request.path, request.options);
          return volume.status();
        });
        SendVolume(status.ok() ? volume : status, answer);
      });
}

}  // namespace tissueform
