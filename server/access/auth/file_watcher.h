// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"

#include "core/base/mutex.h"

namespace tissueform {

// All of a regular file. Waits for no writer, as a pipe would. Errors: Unavailable (it cannot be
// read), InvalidArgument (no regular file, larger than `max_bytes`); without its path.
absl::StatusOr<std::string> ReadBoundedFile(const std::string& path, size_t max_bytes);

// Looks at small files again and again, on a thread of its own, and reports what has become of
// them.
class FileWatcher {
 public:
  // By the watcher's thread: what the file holds now, or why it cannot be read; once at first and
  // then whenever one of the two is new.
  using OnChange = std::function<void(const absl::StatusOr<std::string>& content)>;

  explicit FileWatcher(std::chrono::milliseconds period) : period_(period) {}
  ~FileWatcher();
  FileWatcher(const FileWatcher&) = delete;
  FileWatcher& operator=(const FileWatcher&) = delete;

  // Before Start.
  void Add(std::string path, size_t max_bytes, OnChange on_change);
  void Start();

 private:
  struct File {
    std::string path;
    size_t max_bytes = 0;
    OnChange on_change;
    std::string stamp = {};     // by which it is seen that it has changed
    std::string reported = {};  // digest of the content, or the error; empty: nothing yet
  };

  void Run();
  static void Look(File* file);

  const std::chrono::milliseconds period_;
  std::vector<File> files_;  // the thread's, once it runs

  Mutex mutex_;
  ConditionVariable stop_;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace tissueform
