// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/pacs_bridge/network/instance_sink.h"
#include "core/base/mutex.h"
#include "core/base/process/guarded_program.h"
#include "tests/testing/file_bytes.h"

// DICOM programs of other projects, and a sink that records what it receives.
namespace tissueform::testing {

// How a program ended, and what it said on both streams.
struct ProgramEnd {
  int exit_code = -1;
  std::string said = {};
};

// Runs a program of PATH to its end, at most a minute.
ProgramEnd RunPeer(const std::string& program, const std::vector<std::string>& arguments);

// Whether PATH (or /usr/sbin) has it.
bool HasProgram(const std::string& program);

// A port of loopback that was free a moment ago, for programs that take no 0.
int FreePort();

// True once something listens there; waits up to 20 s.
bool WaitForPort(int port);

// A sink that takes all, or gives the answer that a test has set.
class RecordingSink : public InstanceSink {
 public:
  absl::Status Keep(const ReceivedInstance& instance) override;
  void AssociationEnded(const EndedAssociation& ended) override;
  void ConnectionRefused(const RefusedConnection& refused) override;

  void Answer(absl::Status answer);
  std::vector<ReceivedInstance> instances() const;
  // Waits until so many associations have ended, up to 20 s.
  std::vector<EndedAssociation> WaitForEnds(size_t count) const;
  // "address title: reason" of each refused connection, once there are so many, up to 20 s.
  std::vector<std::string> WaitForRefusals(size_t count) const;

 private:
  mutable Mutex mutex_;
  mutable ConditionVariable changed_;
  absl::Status answer_ ABSL_GUARDED_BY(mutex_);
  std::vector<ReceivedInstance> instances_ ABSL_GUARDED_BY(mutex_);
  std::vector<EndedAssociation> ends_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::string> refusals_ ABSL_GUARDED_BY(mutex_);
};

// The bytes of a PS3.10 file after its meta header.
std::string DataSetOfFile(const std::filesystem::path& path);

}  // namespace tissueform::testing
