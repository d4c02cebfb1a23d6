// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include <sys/types.h>

namespace tissueform::testing {

// A process that starts something and is then killed (SIGKILL), so that nothing it might do at its
// end is done.
//
// REQUIRES: this process has one thread when it is made.
class KilledStarter {
 public:
  // In a child process: calls `start`, which returns a word about what it has started, and waits
  // for its death there, so that objects that `start` has leaked stay.
  explicit KilledStarter(const std::function<std::string()>& start);
  ~KilledStarter();
  KilledStarter(const KilledStarter&) = delete;
  KilledStarter& operator=(const KilledStarter&) = delete;

  // What `start` has returned; empty when it has not.
  const std::string& word() const { return word_; }
  // Returns when it has ended.
  void Kill();

 private:
  pid_t child_ = 0;
  std::string word_;
};

// Whether the other end of a pipe or a connection closes in time; what arrives until then is lost.
bool Closes(int descriptor);

}  // namespace tissueform::testing
