// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cstdlib>
#include <string>

#include "absl/strings/string_view.h"

#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "client/pacs_bridge/dicom/instance_header.h"
#include "client/pacs_bridge/network/multipart_splitter.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/fuzzed_file.h"

namespace tissueform::fuzz {
namespace {

void RequireOfPacs(bool promise) {
  if (!promise) std::abort();
}

// What a splitter makes of a body in pieces of this size.
std::string PartsOf(absl::string_view body, size_t piece) {
  std::string parts;
  bool open = false;
  MultipartSplitter::Events events;
  events.begin = [&] {
    RequireOfPacs(!open);
    open = true;
    return absl::OkStatus();
  };
  events.data = [&](absl::string_view bytes) {
    RequireOfPacs(open);
    parts.append(bytes.data(), bytes.size());
    return absl::OkStatus();
  };
  events.end = [&] {
    RequireOfPacs(open);
    open = false;
    parts += "|";
    return absl::OkStatus();
  };
  auto splitter = MultipartSplitter::Create("multipart/related; boundary=b", events);
  RequireOfPacs(splitter.ok());
  for (size_t at = 0; at < body.size(); at += piece) {
    if (!splitter->Take(body.substr(at, piece)).ok()) return "refused";
  }
  return splitter->Finish().ok() ? parts : "refused";
}

}  // namespace

void FuzzMultipart(const uint8_t* data, size_t size) {
  const absl::string_view body(reinterpret_cast<const char*>(data), size);
  const std::string whole = PartsOf(body, std::max<size_t>(size, 1));
  // Headers that are too long are seen sooner in small pieces.
  if (size < MultipartSplitter::kMaxHeaderBytes) RequireOfPacs(PartsOf(body, 1) == whole);
}

void FuzzInstanceHeader(const uint8_t* data, size_t size) {
  const FuzzedFile file(data, size);
  const auto header = ReadInstanceHeader(file.path());
  if (!header.ok()) return;
  RequireOfPacs(IsDicomUid(header->instance_uid) && IsDicomUid(header->study_uid));
  RequireOfPacs(header->frame_uid.empty() || IsDicomUid(header->frame_uid));
}

}  // namespace tissueform::fuzz
