// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/upload_lines.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace tissueform {
namespace {

// Attempts that fail for the same reason follow each other every 2 s.
constexpr double kQuietSeconds = 10;

std::string PartOf(int64_t bytes, int64_t total_bytes) {
  return absl::StrFormat("%.1f of %.1f MB", 1e-6 * static_cast<double>(bytes),
                         1e-6 * static_cast<double>(total_bytes));
}

}  // namespace

UploadOptions UploadLines::Options() {
  UploadOptions options;
  options.on_progress = [this](int64_t sent_bytes, int64_t total_bytes) {
    Progress(sent_bytes, total_bytes);
  };
  options.on_interrupted = [this](const absl::Status& why) { Interrupted(why); };
  options.on_resumed = [this](int64_t from_bytes, int64_t total_bytes) {
    Resumed(from_bytes == 0 ? "the upload restarts"
                            : absl::StrCat("the upload continues: the server has ",
                                           PartOf(from_bytes, total_bytes), " already"));
  };
  return options;
}

void UploadLines::Interrupted(const absl::Status& why) {
  const double now_s = seconds_();
  if (why.code() == interrupted_by_ && now_s < interrupted_s_ + kQuietSeconds) return;
  interrupted_by_ = why.code();
  interrupted_s_ = now_s;
  resumed_.clear();
  print_(absl::StrCat("upload interrupted (", why.message(), "); trying again"));
}

void UploadLines::Resumed(const std::string& line) {
  if (line == resumed_) return;
  resumed_ = line;
  print_(line);
}

void UploadLines::Progress(int64_t sent_bytes, int64_t total_bytes) {
  const double now_s = seconds_();
  // The last one ends what has begun: what follows is the server's checking.
  const bool ends = has_printed_ && sent_bytes == total_bytes;
  if (now_s < next_s_ && !ends) return;
  next_s_ = now_s + 1;
  has_printed_ = true;
  print_(absl::StrCat("uploading: ", PartOf(sent_bytes, total_bytes)));
}

}  // namespace tissueform
