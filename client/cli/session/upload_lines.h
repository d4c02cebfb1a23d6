// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>

#include "absl/status/status.h"

#include "client/cpp/mesh_upload.h"

namespace tissueform {

// Reports in lines how an upload goes: how far it is, a line a second once it has taken longer than
// one; that it was interrupted, not at every attempt; that it goes on, and where.
class UploadLines {
 public:
  using Print = std::function<void(const std::string& line)>;
  using Seconds = std::function<double()>;  // since the beginning

  UploadLines(Print print, Seconds seconds)
      : print_(std::move(print)), seconds_(std::move(seconds)) {}

  // Options that print these lines. The object must outlive it.
  UploadOptions Options();

 private:
  void Progress(int64_t sent_bytes, int64_t total_bytes);
  void Interrupted(const absl::Status& why);
  void Resumed(const std::string& line);

  const Print print_;
  const Seconds seconds_;
  double next_s_ = 1;
  bool has_printed_ = false;
  absl::StatusCode interrupted_by_ = absl::StatusCode::kOk;
  double interrupted_s_ = 0;
  std::string resumed_;  // the last line of it since an interruption was reported
};

}  // namespace tissueform
