// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/services/service_list.h"

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <string>

#include "gtest/gtest.h"

#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

// The names of the services that the .proto files declare.
std::set<std::string> DeclaredServices() {
  const std::regex declaration(R"(^service (\w+) \{)");
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(SourcePath("proto/tissueform/v1"))) {
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);) {
      std::smatch match;
      if (std::regex_search(line, match, declaration)) names.insert(match[1]);
    }
  }
  return names;
}

TEST(ServiceListTest, HasEveryServiceOfTheProtoFiles) {
  std::set<std::string> listed;
  for (const auto* service : AllServices()) listed.insert(std::string(service->name()));
  EXPECT_EQ(listed, DeclaredServices());
  EXPECT_EQ(listed.size(), AllServices().size());
}

}  // namespace
}  // namespace tissueform::testing
