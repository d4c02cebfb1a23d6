// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/run_tissueform.h"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fcntl.h>
#include <fstream>
#include <regex>
#include <sstream>
#include <unistd.h>

#include <sys/resource.h>
#include <sys/wait.h>

#include "tests/testing/file_bytes.h"
#include "tests/testing/meshes.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

// Without the lines of StageTimes, and those of StageProgress, which come when a machine is slow
// and not otherwise.
std::string WithoutProgress(const std::string& err) {
  static const std::regex kProgress(
      "[a-z0-9_ ]+((: [a-z0-9, ]+)? \\.\\.\\.|: [0-9]+\\.[0-9] s)|\\[ *[0-9]+ % +[0-9]+\\.[0-9] "
      "s\\] .+");
  std::istringstream lines(err);
  std::string kept;
  for (std::string line; std::getline(lines, line);) {
    if (!std::regex_match(line, kProgress)) kept += line + "\n";
  }
  return kept;
}

void Redirect(int descriptor, const std::filesystem::path& path) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  dup2(file, descriptor);
}

void LimitFileSize(int64_t max_file_bytes) {
  if (max_file_bytes < 0) return;
  std::signal(SIGXFSZ, SIG_IGN);  // so that write() fails instead of ending the program
  const rlimit limit{static_cast<rlim_t>(max_file_bytes), static_cast<rlim_t>(max_file_bytes)};
  setrlimit(RLIMIT_FSIZE, &limit);
}

}  // namespace

ProcessResult RunCommandLine(const std::vector<std::string>& arguments,
                             const std::filesystem::path& folder, int64_t max_file_bytes) {
  const std::string program = ProgramPath("tissueform");
  std::vector<char*> argv = {const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const std::filesystem::path out = folder.string() + ".stdout";
  const std::filesystem::path err = folder.string() + ".stderr";
  const pid_t child = fork();
  if (child == 0) {
    Redirect(STDOUT_FILENO, out);
    Redirect(STDERR_FILENO, err);
    LimitFileSize(max_file_bytes);
    if (chdir(folder.c_str()) == 0) execv(program.c_str(), argv.data());
    _exit(127);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ProcessResult result{WIFEXITED(status) ? WEXITSTATUS(status) : -1, BytesOfFile(out),
                       WithoutProgress(BytesOfFile(err))};
  std::filesystem::remove(out);
  std::filesystem::remove(err);
  return result;
}

void CliTest::SetUp() {
  const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
  folder_ = std::filesystem::path(::testing::TempDir()) / "client_cli_test" /
            (std::string(info->test_suite_name()) + "." + info->name());
  std::filesystem::remove_all(folder_);
  std::filesystem::create_directories(folder_);
}

void CliTest::TearDown() { std::filesystem::remove_all(folder_); }

void CliTest::Write(const std::string& name, const std::string& contents) const {
  std::ofstream(folder_ / name, std::ios::binary) << contents;
}

std::string CliTest::Read(const std::string& name) const { return BytesOfFile(folder_ / name); }

std::string CliTest::SchemaFindings(const std::string& schema, const std::string& name,
                                    const std::vector<std::string>& optional) const {
  // Debian's Python has the modules of deploy/packages.txt; another may come first in PATH.
  std::string command = "/usr/bin/python3 -B " + SourcePath("tests/testing/check_schema.py") + " " +
                        SourcePath("docs/" + schema) + " " + Path(name);
  for (const std::string& object : optional) command += " --optional '" + object + "'";
  const std::string findings = folder_.string() + ".findings";
  const int status = std::system((command + " > " + findings + " 2>&1").c_str());
  const std::string text = BytesOfFile(findings);
  std::filesystem::remove(findings);
  if (status == 0) return "";
  return text.empty() ? "check_schema.py did not run" : text;
}

std::vector<std::string> CliTest::Files() const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

void CliTest::WriteBar() const {
  std::filesystem::copy_file(TestDataPath("plans/bar/bar.vtu"), folder_ / "bar.vtu");
}

}  // namespace tissueform::testing
