// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "client/cli/account/signing_key.h"
#include "server/access/auth/authenticator.h"
#include "server/access/auth/token_options.h"

namespace tissueform::testing {

inline constexpr char kIssuer[] = "https://login.example";
inline constexpr char kAudience[] = "tissueform";

// The same in the whole program: RSA keys take their time.
inline const SigningKey& EcKey() {
  static const SigningKey key = *SigningKey::MakeP256();
  return key;
}
inline const SigningKey& OtherEcKey() {
  static const SigningKey key = *SigningKey::MakeP256();
  return key;
}
inline const SigningKey& RsaKey() {
  static const SigningKey key = *SigningKey::MakeRsa(2048);
  return key;
}

inline int64_t SecondsFromNow(int64_t seconds) {
  return std::chrono::duration_cast<std::chrono::seconds>(
             std::chrono::system_clock::now().time_since_epoch())
             .count() +
         seconds;
}

// Of "alice", good for an hour.
inline nlohmann::json GoodClaims() {
  return {{"iss", kIssuer},
          {"aud", kAudience},
          {"sub", "alice"},
          {"iat", SecondsFromNow(-5)},
          {"exp", SecondsFromNow(3600)}};
}

inline nlohmann::json With(nlohmann::json object, const std::string& name,
                           const nlohmann::json& value) {
  object[name] = value;
  return object;
}

inline nlohmann::json Without(nlohmann::json object, const std::string& name) {
  object.erase(name);
  return object;
}

// Both keys in one set.
inline std::string JwksOf(const SigningKey& first, const SigningKey& second) {
  nlohmann::json set = first.PublicJwks();
  set["keys"].push_back(second.PublicJwks()["keys"][0]);
  return set.dump();
}

// True as soon as `condition` holds; false when it does not within 30 s.
template <typename Condition>
bool Soon(const Condition& condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::yield();
  }
  return true;
}

// At once and whole, as a site should write it.
inline void Replace(const std::filesystem::path& path, const std::string& content) {
  const std::string fresh = path.string() + ".new";
  std::ofstream(fresh, std::ios::binary) << content;
  std::filesystem::rename(fresh, path);
}

// Files of a server that takes tokens, in a folder of the test's own.
class TokenFiles {
 public:
  TokenFiles() {
    const ::testing::TestInfo* test = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(test->test_suite_name()) + "." + test->name();
    for (char& c : name) c = c == '/' ? '_' : c;
    folder_ = std::filesystem::path(::testing::TempDir()) / name;
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    Replace(keys(), JwksOf(EcKey(), RsaKey()));
    Replace(revocations(), "{}");
  }
  ~TokenFiles() { std::filesystem::remove_all(folder_); }

  std::filesystem::path keys() const { return folder_ / "keys"; }
  std::filesystem::path revocations() const { return folder_ / "revocations.json"; }

  TokenOptions Options() const {
    TokenOptions options{.issuer = kIssuer, .audiences = {kAudience}};
    options.keys_file = keys().string();
    options.revocations_file = revocations().string();
    options.file_period = std::chrono::milliseconds(10);
    return options;
  }

 private:
  std::filesystem::path folder_;
};

}  // namespace tissueform::testing
