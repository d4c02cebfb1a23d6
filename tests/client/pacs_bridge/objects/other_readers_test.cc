// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// What is written is opened by programs that nobody here wrote.

#include <fstream>

#include "absl/strings/str_split.h"
#include "gmock/gmock.h"

#include "client/pacs_bridge/objects/capture_object.h"
#include "tests/client/pacs_bridge/objects/objects_fixture.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class OtherReadersTest : public ObjectsFixture {};

TEST_F(OtherReadersTest, DciodvfyFindsNoErrorInAnyObject) {
  if (!Has("dciodvfy")) GTEST_SKIP() << "dicom3tools is not installed";
  for (const auto& [key, object] : Write(MakeInput())) {
    Run("dciodvfy " + object.path);
    EXPECT_THAT(Said(), Not(HasSubstr("Error"))) << key;
    // It has recognised the kind of object, and so has looked into it.
    EXPECT_THAT(Said(), Not(HasSubstr("not recognized"))) << key << Said();
  }
}

}  // namespace
}  // namespace tissueform::testing
