// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/multipart_splitter.h"

#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxBoundaryCharacters = 70;  // RFC 2046

absl::Status NotMultipart(absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat("invalid multipart/related answer: ", why));
}

// The value of boundary=, quoted or not; empty: none.
std::string BoundaryOf(absl::string_view content_type) {
  for (absl::string_view parameter : absl::StrSplit(content_type, ';')) {
    parameter = absl::StripAsciiWhitespace(parameter);
    constexpr absl::string_view kName = "boundary=";
    if (!absl::StartsWithIgnoreCase(parameter, kName)) continue;
    parameter.remove_prefix(kName.size());
    if (parameter.size() >= 2 && parameter.front() == '"' && parameter.back() == '"') {
      parameter = parameter.substr(1, parameter.size() - 2);
    }
    return std::string(parameter);
  }
  return {};
}

}  // namespace

absl::StatusOr<MultipartSplitter> MultipartSplitter::Create(absl::string_view content_type,
                                                            Events events) {
  if (!absl::StartsWithIgnoreCase(content_type, "multipart/related")) {
    return NotMultipart("it has another type");
  }
  const std::string boundary = BoundaryOf(content_type);
  if (boundary.empty() || boundary.size() > kMaxBoundaryCharacters) {
    return NotMultipart("it has no boundary of 1 to 70 characters");
  }
  return MultipartSplitter(boundary, std::move(events));
}

MultipartSplitter::MultipartSplitter(const std::string& boundary, Events events)
    : events_(std::move(events)),
      delimiter_(absl::StrCat("\r\n--", boundary)),
      buffer_("\r\n") {}  // as if a line came before the first boundary

absl::Status MultipartSplitter::Take(absl::string_view piece) {
  buffer_.append(piece.data(), piece.size());
  while (true) {
    TF_ASSIGN_OR_RETURN(const bool again, Step());
    if (!again) return absl::OkStatus();
  }
}

absl::StatusOr<bool> MultipartSplitter::Step() {
  switch (state_) {
    case State::kPreamble:
    case State::kData:
      return StepData();
    case State::kAfterBoundary: {
      // "--" ends the body; else the line ends here.
      if (buffer_.size() < 2) return false;
      if (absl::StartsWith(buffer_, "--")) {
        state_ = State::kEpilogue;
        return true;
      }
      const size_t line = buffer_.find("\r\n");
      if (line == std::string::npos) {
        if (buffer_.size() > kMaxHeaderBytes) return NotMultipart("a boundary's line is too long");
        return false;
      }
      buffer_.erase(0, line);  // the headers may be none: an empty line follows then
      state_ = State::kHeaders;
      return true;
    }
    case State::kHeaders: {
      const size_t end = buffer_.find("\r\n\r\n");
      if (end == std::string::npos) {
        if (buffer_.size() > kMaxHeaderBytes) return NotMultipart("a part has too many headers");
        return false;
      }
      buffer_.erase(0, end + 4);
      state_ = State::kData;
      TF_RETURN_IF_ERROR(events_.begin());
      return true;
    }
    case State::kEpilogue:
      buffer_.clear();
      return false;
  }
  return false;
}

absl::StatusOr<bool> MultipartSplitter::StepData() {
  const bool in_part = state_ == State::kData;
  const size_t at = buffer_.find(delimiter_);
  if (at != std::string::npos) {
    if (in_part && at > 0) {
      TF_RETURN_IF_ERROR(events_.data(absl::string_view(buffer_).substr(0, at)));
    }
    if (in_part) TF_RETURN_IF_ERROR(events_.end());
    buffer_.erase(0, at + delimiter_.size());
    state_ = State::kAfterBoundary;
    return true;
  }
  // All but what may be the beginning of a boundary.
  if (buffer_.size() >= delimiter_.size()) {
    const size_t sure = buffer_.size() - delimiter_.size() + 1;
    if (in_part) TF_RETURN_IF_ERROR(events_.data(absl::string_view(buffer_).substr(0, sure)));
    buffer_.erase(0, sure);
  }
  return false;
}

absl::Status MultipartSplitter::Finish() const {
  if (state_ == State::kEpilogue) return absl::OkStatus();
  return NotMultipart("it ends before its last boundary");
}

}  // namespace tissueform
