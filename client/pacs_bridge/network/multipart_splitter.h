// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// Takes a multipart/related body (RFC 2046) apart as it comes, in pieces of any size, without
// keeping a part: no library of Debian does that without a server around it.
class MultipartSplitter {
 public:
  struct Events {
    std::function<absl::Status()> begin;                  // of a part, after its headers
    std::function<absl::Status(absl::string_view)> data;  // of it, in pieces
    std::function<absl::Status()> end;
  };

  // A part's headers are no longer.
  static constexpr size_t kMaxHeaderBytes = 16 << 10;

  // `content_type` is that of the answer. Errors: InvalidArgument (not multipart/related, or an
  // invalid boundary).
  static absl::StatusOr<MultipartSplitter> Create(absl::string_view content_type, Events events);

  // Errors: those of the events; InvalidArgument (not as the standard wants it).
  absl::Status Take(absl::string_view piece);
  // The body is over. Errors: InvalidArgument when it ended within a part.
  absl::Status Finish() const;

 private:
  enum class State { kPreamble, kHeaders, kData, kAfterBoundary, kEpilogue };

  MultipartSplitter(const std::string& boundary, Events events);

  // One step with what is in the buffer; false: more is needed.
  absl::StatusOr<bool> Step();
  absl::StatusOr<bool> StepData();

  Events events_;
  std::string delimiter_;  // CRLF -- boundary
  State state_ = State::kPreamble;
  std::string buffer_;
};

}  // namespace tissueform
