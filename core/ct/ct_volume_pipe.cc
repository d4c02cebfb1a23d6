// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/ct/ct_volume_pipe.h"

#include "core/base/status_macros.h"
#include "core/process/pipe_stream.h"

namespace tissueform {
namespace {

constexpr int64_t kMostNotes = 1000;
constexpr int64_t kMostOtherBytes = int64_t{1} << 26;  // everything but the voxels

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
  TF_ASSIGN_OR_RETURN(const int64_t num_notes, receiver->Number(kMostNotes));
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

}  // namespace

bool SendCtVolume(int descriptor, const absl::StatusOr<CtVolume>& volume) {
  PipeSender sender(descriptor);
  sender.Outcome(volume.status());
  if (!volume.ok()) return sender.ok();
  for (const int size : volume->size) sender.Number(size);
  sender.Bytes(volume->spacing_mm.data(), sizeof(volume->spacing_mm));
  sender.Bytes(volume->origin_mm.data(), sizeof(volume->origin_mm));
  sender.Bytes(volume->direction.data(), sizeof(volume->direction));
  SendProvenance(volume->provenance, &sender);
  sender.Bytes(volume->hu.data(), volume->hu.size() * sizeof(int16_t));
  return sender.ok();
}

absl::StatusOr<CtVolume> ReceiveCtVolume(int descriptor, int64_t max_voxels) {
  constexpr auto kVoxelBytes = static_cast<int64_t>(sizeof(int16_t));
  PipeReceiver receiver(descriptor, kMostOtherBytes);
  TF_RETURN_IF_ERROR(receiver.Outcome());
  CtVolume volume;
  TF_RETURN_IF_ERROR(ReceiveSize(&receiver, max_voxels, &volume));
  TF_RETURN_IF_ERROR(receiver.Bytes(volume.spacing_mm.data(), sizeof(volume.spacing_mm)));
  TF_RETURN_IF_ERROR(receiver.Bytes(volume.origin_mm.data(), sizeof(volume.origin_mm)));
  TF_RETURN_IF_ERROR(receiver.Bytes(volume.direction.data(), sizeof(volume.direction)));
  TF_RETURN_IF_ERROR(ReceiveProvenance(&receiver, &volume.provenance));
  volume.hu.resize(static_cast<size_t>(volume.num_voxels()));
  TF_RETURN_IF_ERROR(receiver.Bytes(volume.hu.data(), volume.hu.size() * kVoxelBytes));
  return volume;
}

}  // namespace tissueform
