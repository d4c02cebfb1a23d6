// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/json/json_schema.h"

#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "core/base/json/schema_versions.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using tissueform::testing::IsOk;
using tissueform::testing::StatusIs;
using Json = nlohmann::json;

// A format whose version 2 added a key, a key within an object and a form of a value, and whose
// version 3 added an object.
constexpr char kGrown[] = R"({
  "type": "object",
  "additionalProperties": false,
  "required": ["format", "version", "size"],
  "properties": {
    "format": {"const": "house"},
    "version": {"enum": [1, 2, 3]},
    "size": {"anyOf": [{"type": "number"}, {"type": "string", "since_version": 2}]},
    "door": {"$ref": "#/definitions/door"},
    "colour": {"description": "of the walls", "type": "string", "since_version": 2},
    "garden": {
      "type": "object",
      "additionalProperties": false,
      "required": ["trees"],
      "properties": {"trees": {"type": "integer"}},
      "since_version": 3
    }
  },
  "definitions": {
    "door": {
      "type": "object",
      "additionalProperties": false,
      "properties": {
        "wide_mm": {"type": "number"},
        "high_mm": {"type": "number", "since_version": 2}
      }
    }
  }
})";

const JsonSchema& Grown() {
  static const auto* const schema = new JsonSchema(kGrown);
  return *schema;
}

Json House(int version, const std::string& keys = "") {
  return Json::parse(R"({"format": "house", "size": 3, "version": )" + std::to_string(version) +
                     (keys.empty() ? "" : ", " + keys) + "}");
}

auto IsRefused(const std::string& why) {
  return StatusIs(absl::StatusCode::kInvalidArgument, AllOf(HasSubstr(why), Not(HasSubstr("\n"))));
}

TEST(JsonSchemaTest, EveryVersionUpToTheNewestIsRead) {
  for (const int version : {1, 2, 3}) {
    EXPECT_THAT(Grown().Check(House(version)), IsOk());
    EXPECT_THAT(Grown().Check(House(version, R"("door": {"wide_mm": 900})")), IsOk());
  }
}

TEST(JsonSchemaTest, AKeyIsReadFromTheVersionOnThatItCameWith) {
  const std::string garden = R"("garden": {"trees": 2})";
  EXPECT_THAT(Grown().Check(House(3, garden)), IsOk());
  EXPECT_THAT(Grown().Check(House(2, garden)),
              IsRefused("key \"garden\" at / came with version 3 of the format"));
  EXPECT_THAT(Grown().Check(House(2, R"("colour": "red")")), IsOk());
  EXPECT_THAT(Grown().Check(House(1, R"("colour": "red")")),
              IsRefused("key \"colour\" at / came with version 2 of the format"));
  EXPECT_THAT(Grown().Check(House(1, R"("door": {"high_mm": 2000})")),
              IsRefused("key \"high_mm\" at /door came with version 2 of the format"));
}

TEST(JsonSchemaTest, TheErrorNamesALaterVersionThatAllowsTheValue) {
  Json named = House(1);
  named["size"] = "large";
  EXPECT_THAT(Grown().Check(named), IsRefused("(as \"version\": 2 it would be read)"));
  named["version"] = Json::parse("2");
  EXPECT_THAT(Grown().Check(named), IsOk());
}

TEST(JsonSchemaTest, UnknownKeyListsTheKeysAllowedInItsVersion) {
  for (const int version : {1, 2, 3}) {
    EXPECT_THAT(Grown().Check(House(version, R"("roof": 1)")),
                IsRefused("unknown key \"roof\" at /; allowed there: "));
  }
  EXPECT_THAT(Grown().Check(House(1, R"("roof": 1)")), Not(IsRefused("colour")));
  EXPECT_THAT(Grown().Check(House(2, R"("roof": 1)")), IsRefused("colour"));
}

TEST(JsonSchemaTest, ErrorsEscapeLineBreaksAndTerminalCommandsInKeys) {
  EXPECT_THAT(Grown().Check(House(1, R"("roof\n\u001b[2J": 1)")),
              IsRefused(R"(unknown key "roof\x0a\x1b[2J" at /)"));
}

TEST(JsonSchemaTest, AFileOfANewerProgramIsRefusedAsSuch) {
  EXPECT_THAT(
      Grown().Check(House(4, R"("cellar": true)")),
      IsRefused("wrong value at /version: 4 must be 1 to 3; it was made for a newer program"));
  EXPECT_THAT(Grown().Check(Json::parse(R"({"format": "ship", "version": 4, "size": 1})")),
              IsRefused("wrong value at /format"));
}

TEST(JsonSchemaTest, RefusesInvalidVersions) {
  for (const char* version : {"0", "-1", "1.5", "\"1\"", "null", "[1]", "1e300"}) {
    Json house = House(1);
    house["version"] = Json::parse(version);
    EXPECT_THAT(Grown().Check(house), IsRefused("/version")) << version;
  }
  Json house = House(1);
  house.erase("version");
  EXPECT_THAT(Grown().Check(house), IsRefused("missing key \"version\" at /"));
}

TEST(JsonSchemaTest, LowestVersionIsTheOneThatHasAllKeys) {
  EXPECT_EQ(Grown().LowestVersion(House(3)), 1);
  EXPECT_EQ(Grown().LowestVersion(House(1, R"("colour": "red")")), 2);
  EXPECT_EQ(Grown().LowestVersion(House(1, R"("garden": {"trees": 2})")), 3);
}

TEST(SchemaVersionsTest, WithoutAListThereIsOneVersion) {
  const JsonSchema plain(R"({"type": "object", "properties": {"version": {"const": 1}}})");
  EXPECT_EQ(NewestVersion(plain.json()), 1);
  EXPECT_EQ(NewestVersion(Grown().json()), 3);
  EXPECT_EQ(SchemaOfVersion(Grown().json(), 3), Grown().json());
}

}  // namespace
}  // namespace tissueform
