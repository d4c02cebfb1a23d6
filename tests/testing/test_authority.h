// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace tissueform::testing {

// A certificate with its key, both PEM.
struct TestIdentity {
  std::string certificate = {};
  std::string key = {};
};

// Files of an identity, and of who signed it; the key readable by its owner alone.
struct TestFiles {
  std::string certificate = {};
  std::string key = {};
  std::string roots = {};
};

// What an issued certificate says.
struct TestCertificate {
  std::string name = "localhost";  // the CN
  std::string alternatives = "DNS:localhost,IP:127.0.0.1";
  std::chrono::hours begins{-1};  // from now
  std::chrono::hours ends{24};
};

// An authority that issues certificates for tests, with keys of P-256. Ends the program on errors.
class TestAuthority {
 public:
  explicit TestAuthority(const std::string& name = "Test authority");
  ~TestAuthority();
  TestAuthority(const TestAuthority&) = delete;
  TestAuthority& operator=(const TestAuthority&) = delete;

  const std::string& certificate() const { return own_; }
  TestIdentity Issue(const TestCertificate& content = {}) const;
  // The same, as files NAME.pem, NAME.key and NAME-ca.pem of `folder`, in place of those before.
  TestFiles IssueFiles(const std::filesystem::path& folder, const std::string& name,
                       const TestCertificate& content = {}) const;

 private:
  struct Secret;
  const std::unique_ptr<Secret> secret_;
  std::string own_;
};

// A folder of this test's own, empty. `name` is one for each.
std::filesystem::path EmptyTestFolder(const std::string& name);
void WriteTestFile(const std::filesystem::path& path, const std::string& content);

}  // namespace tissueform::testing
