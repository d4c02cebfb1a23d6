// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/process/pipe_stream.h"

#include <cerrno>
#include <unistd.h>

#include <sys/socket.h>

#include "core/base/status_macros.h"

namespace tissueform {

namespace {

// A socket whose other end is closed would raise SIGPIPE and end the program; for a pipe, which
// only helper programs write to, they ignore that signal themselves.
ssize_t WriteSome(int descriptor, const char* data, size_t size) {
  const ssize_t sent = send(descriptor, data, size, MSG_NOSIGNAL);
  return sent < 0 && errno == ENOTSOCK ? write(descriptor, data, size) : sent;
}

}  // namespace

void PipeSender::Bytes(const void* data, size_t size) {
  const char* next = static_cast<const char*>(data);
  while (ok_ && size > 0) {
    const ssize_t written = WriteSome(descriptor_, next, size);
    if (written < 0 && errno == EINTR) continue;
    ok_ = written > 0;
    next += ok_ ? written : 0;
    size -= ok_ ? static_cast<size_t>(written) : 0;
  }
}

void PipeSender::Number(int64_t number) { Bytes(&number, sizeof(number)); }

void PipeSender::Text(absl::string_view text) {
  text = text.substr(0, kMaxTextBytes);
  Number(static_cast<int64_t>(text.size()));
  Bytes(text.data(), text.size());
}

void PipeSender::Outcome(const absl::Status& status) {
  Number(static_cast<int64_t>(status.code()));
  Text(status.message());
}

absl::Status PipeReceiver::BrokenOff() {
  return absl::DataLossError("the data from the child process is incomplete or invalid");
}

absl::Status PipeReceiver::Bytes(void* data, size_t size) {
  char* next = static_cast<char*>(data);
  while (size > 0) {
    const ssize_t count = read(descriptor_, next, size);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return BrokenOff();
    next += count;
    size -= static_cast<size_t>(count);
  }
  return absl::OkStatus();
}

absl::StatusOr<int64_t> PipeReceiver::Number(int64_t most) {
  int64_t number = 0;
  TF_RETURN_IF_ERROR(Bytes(&number, sizeof(number)));
  if (number < 0 || number > most) return BrokenOff();
  return number;
}

absl::StatusOr<std::string> PipeReceiver::Text() {
  TF_ASSIGN_OR_RETURN(const int64_t size, Number(PipeSender::kMaxTextBytes));
  TF_RETURN_IF_ERROR(Reserve(size, 1));
  std::string text(static_cast<size_t>(size), '\0');
  TF_RETURN_IF_ERROR(Bytes(text.data(), text.size()));
  return text;
}

absl::Status PipeReceiver::Outcome() {
  constexpr auto kLastCode = static_cast<int64_t>(absl::StatusCode::kUnauthenticated);
  TF_ASSIGN_OR_RETURN(const int64_t code, Number(kLastCode));
  TF_ASSIGN_OR_RETURN(const std::string message, Text());
  return {static_cast<absl::StatusCode>(code), message};
}

absl::Status PipeReceiver::Reserve(int64_t count, int64_t size) {
  if (count > bytes_left_ / size) {
    return absl::ResourceExhaustedError("the data is larger than the memory limit");
  }
  bytes_left_ -= count * size;
  return absl::OkStatus();
}

absl::Status PipeReceiver::Shape(int64_t most_columns, int64_t scalar_bytes, int64_t* rows,
                                 int64_t* columns) {
  TF_ASSIGN_OR_RETURN(*rows, Number(INT32_MAX));
  TF_ASSIGN_OR_RETURN(*columns, Number(most_columns));
  return Reserve(*rows * *columns, scalar_bytes);
}

}  // namespace tissueform
