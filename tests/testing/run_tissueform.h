// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace tissueform::testing {

// What a child process left behind.
struct ProcessResult {
  int exit_code = -1;  // -1 when a signal ended it
  std::string out;
  std::string err;  // without the lines of progress
};

// Runs the program that is tested, in `folder`. With a limit it cannot write files beyond that
// size, as on a full disk.
ProcessResult RunCommandLine(const std::vector<std::string>& arguments,
                             const std::filesystem::path& folder, int64_t max_file_bytes = -1);

// Exit code 1 or 2, nothing on stdout unless allowed, and exactly one line on stderr that starts
// with "tissueform: ".
MATCHER_P2(FailsWith, exit_code, message_matcher, "") {
  *result_listener << "exit code " << arg.exit_code << ", stderr: " << arg.err;
  const bool is_one_line = !arg.err.empty() && arg.err.find('\n') == arg.err.size() - 1;
  return arg.exit_code == exit_code && is_one_line && arg.err.rfind("tissueform: ", 0) == 0 &&
         ::testing::ExplainMatchResult(message_matcher, arg.err, result_listener);
}

MATCHER(Succeeds, "exits with 0 and a silent stderr") {
  *result_listener << "exit code " << arg.exit_code << ", stderr: " << arg.err;
  return arg.exit_code == 0 && arg.err.empty();
}

// A test with a folder of its own, in which the program runs.
class CliTest : public ::testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;

  ProcessResult Run(const std::vector<std::string>& arguments) const {
    return RunCommandLine(arguments, folder_);
  }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  void Write(const std::string& name, const std::string& contents) const;
  std::string Read(const std::string& name) const;
  // What check_schema.py finds of a file here and a schema of docs, "outcome.schema.json"; nothing
  // where the file follows it and the schema refuses each damage. Keys of `optional` objects may
  // be missing.
  std::string SchemaFindings(const std::string& schema, const std::string& name,
                             const std::vector<std::string>& optional = {}) const;
  // Names of all files in the folder, sorted.
  std::vector<std::string> Files() const;
  // Puts bar.vtu, the mesh of the bundled plan, into the folder.
  void WriteBar() const;

  std::filesystem::path folder_;
};

}  // namespace tissueform::testing
