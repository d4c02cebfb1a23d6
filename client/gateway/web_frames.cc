// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/web_frames.h"

#include <cstdint>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

constexpr size_t kHeadBytes = 5;
constexpr uint8_t kMessageFlag = 0x00;
constexpr uint8_t kCompressedFlag = 0x01;
constexpr uint8_t kTrailersFlag = 0x80;

std::string Frame(uint8_t flag, absl::string_view payload) {
  const auto size = static_cast<uint32_t>(payload.size());
  std::string frame;
  frame.reserve(kHeadBytes + payload.size());
  frame.push_back(static_cast<char>(flag));
  for (const int shift : {24, 16, 8, 0}) frame.push_back(static_cast<char>(size >> shift));
  frame.append(payload.data(), payload.size());
  return frame;
}

uint32_t SizeIn(absl::string_view head) {
  uint32_t size = 0;
  for (size_t i = 1; i < kHeadBytes; ++i) size = size << 8 | static_cast<uint8_t>(head[i]);
  return size;
}

// As `grpc-message` travels.
std::string PercentEncode(absl::string_view text) {
  std::string encoded;
  for (const char c : text) {
    if (c >= ' ' && c <= '~' && c != '%') {
      encoded += c;
    } else {
      absl::StrAppendFormat(&encoded, "%%%02X", static_cast<unsigned char>(c));
    }
  }
  return encoded;
}

}  // namespace

bool IsWebContentType(absl::string_view content_type) {
  const absl::string_view type =
      absl::StripAsciiWhitespace(content_type.substr(0, content_type.find(';')));
  return type == kWebContentType || type == "application/grpc-web";
}

absl::StatusOr<absl::string_view> ParseWebRequest(absl::string_view body) {
  if (body.size() < kHeadBytes) {
    return absl::InvalidArgumentError("request: the frame's head is incomplete; send one message");
  }
  const auto flag = static_cast<uint8_t>(body[0]);
  if (flag == kCompressedFlag) {
    return absl::UnimplementedError("request: the message is compressed; send it uncompressed");
  }
  if (flag != kMessageFlag) {
    return absl::InvalidArgumentError("request: the frame is not a message; send one message");
  }
  if (SizeIn(body) != body.size() - kHeadBytes) {
    return absl::InvalidArgumentError(absl::StrCat("request: the frame states ", SizeIn(body),
                                                   " bytes, ", body.size() - kHeadBytes,
                                                   " follow; send one message"));
  }
  return body.substr(kHeadBytes);
}

std::string WebMessageFrame(absl::string_view message) { return Frame(kMessageFlag, message); }

HttpFields WebEndFields(const CallEnd& end) {
  HttpFields fields = {{"grpc-status", absl::StrCat(end.status.error_code())}};
  if (!end.status.error_message().empty()) {
    fields.emplace_back("grpc-message", PercentEncode(end.status.error_message()));
  }
  if (!end.status.error_details().empty()) {
    fields.emplace_back("grpc-status-details-bin", absl::Base64Escape(end.status.error_details()));
  }
  for (const auto& trailer : end.trailers) fields.push_back(trailer);
  return fields;
}

std::string WebEndFrame(const CallEnd& end) {
  std::string text;
  for (const auto& [name, value] : WebEndFields(end)) {
    absl::StrAppend(&text, name, ": ", value, "\r\n");
  }
  return Frame(kTrailersFlag, text);
}

}  // namespace tissueform
