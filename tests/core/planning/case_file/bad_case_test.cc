// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <cstring>
#include <functional>
#include <random>
#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"

#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_file/case_writer.h"
#include "core/planning/case_file/glb_container.h"
#include "tests/core/planning/case_file/sample_case.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::IsOk;
using testing::kInvalid;
using ::testing::Not;
using testing::StatusIs;
using Json = nlohmann::json;

const std::string& GoodCase() {
  static const std::string* const bytes = new std::string(*SerializeCase(SampleCase()));
  return *bytes;
}

uint32_t WordAt(const std::string& bytes, size_t offset) {
  uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, 4);
  return word;
}

void SetWord(std::string* bytes, size_t offset, uint32_t word) {
  std::memcpy(bytes->data() + offset, &word, 4);
}

// The case with other JSON and the same bytes behind it.
std::string WithJson(const std::function<void(Json*)>& change) {
  const std::string& good = GoodCase();
  const size_t json_bytes = WordAt(good, 12);
  Json json = Json::parse(good.substr(20, json_bytes));
  change(&json);
  std::string text = json.dump();
  text.append((4 - text.size() % 4) % 4, ' ');
  std::string changed = good.substr(0, 20) + text + good.substr(20 + json_bytes);
  SetWord(&changed, 8, static_cast<uint32_t>(changed.size()));
  SetWord(&changed, 12, static_cast<uint32_t>(text.size()));
  return changed;
}

Json& Ours(Json* json) { return (*json)["extensions"][kCaseExtension]; }

// The case with other bytes in the buffer view of that number.
std::string WithView(size_t view, const std::function<void(char*, size_t)>& change) {
  std::string changed = GoodCase();
  const Glb glb = *ParseGlb(changed, kMaxCaseJsonBytes);
  change(changed.data() + (glb.views[view].data() - changed.data()), glb.views[view].size());
  return changed;
}

struct BadJson {
  const char* name;
  std::function<void(Json*)> change;
  const char* message;
};

class BadJsonTest : public ::testing::TestWithParam<BadJson> {};

TEST_P(BadJsonTest, IsRefusedWithItsPlace) {
  const absl::StatusOr<CaseFile> read = ParseCase(WithJson(GetParam().change));
  EXPECT_THAT(read, StatusIs(kInvalid, HasSubstr(GetParam().message)));
  EXPECT_THAT(std::string(read.status().message()), Not(HasSubstr("\n")));
}

INSTANTIATE_TEST_SUITE_P(
    Lies, BadJsonTest,
    ::testing::Values(
        BadJson{"NoExtension", [](Json* j) { j->erase("extensions"); }, "not a case"},
        BadJson{"NewerVersion", [](Json* j) { Ours(j)["version"] = 3; }, "newer program"},
        BadJson{"UnknownKey", [](Json* j) { Ours(j)["colour"] = "red"; }, "colour"},
        BadJson{"ContactInVersionOne", [](Json* j) { Ours(j)["contact"] = {{"rows", 3}}; }, "\"contact\" at / came with version 2"},
        BadJson{"ContactWithoutRows", [](Json* j) { Ours(j)["version"] = 2; Ours(j)["contact"] = {{"rows", 0}}; }, "/contact/rows"},
        BadJson{"HalfAPair", [](Json* j) { Ours(j)["version"] = 2; Ours(j)["contact"] = {{"rows", 3}, {"sticking", Ours(j)["surfaces"][0]["regions"]}}; }, "/contact/sticking"},
        BadJson{"NoNotice", [](Json* j) { Ours(j).erase("notice"); }, "notice"},
        BadJson{"ViewThatIsNot", [](Json* j) { Ours(j)["session_request"] = 1000; }, "/session_request"},
        BadJson{"NegativeView", [](Json* j) { Ours(j)["session_request"] = -1; }, "/session_request"},
        BadJson{"FewerTets", [](Json* j) { Ours(j)["mesh"]["tet_count"] = 7; }, "/mesh/payload"},
        BadJson{"MostTets", [](Json* j) { Ours(j)["mesh"]["tet_count"] = 2147483647; }, "/mesh/payload"},
        BadJson{"MeshThatIsNot", [](Json* j) { Ours(j)["surfaces"][0]["mesh"] = 5; }, "/surfaces/0/mesh"},
        BadJson{"HandleThatIsNot", [](Json* j) { Ours(j)["surfaces"][1]["handle"] = "jaw"; }, "/surfaces/1/handle"},
        BadJson{"SegmentWithoutHandle", [](Json* j) { Ours(j)["surfaces"][1].erase("handle"); }, "/surfaces/1"},
        BadJson{"HandleTwice", [](Json* j) { Ours(j)["handles"].push_back(Ours(j)["handles"][0]); }, "/handles"},
        BadJson{"RegionTwice", [](Json* j) { Ours(j)["skin_regions"].push_back(Ours(j)["skin_regions"][0]); }, "/skin_regions"},
        BadJson{"RegionWithoutName", [](Json* j) { Ours(j)["skin_regions"][0]["number"] = 9; }, "/surfaces/0/regions"},
        BadJson{"LandmarkOffTheSkin", [](Json* j) { Ours(j)["landmarks"][1]["skin_vertex"] = 4000; }, "/landmarks/1/skin_vertex"},
        BadJson{"LandmarkOnNoHandle", [](Json* j) { Ours(j)["landmarks"][0]["handle"] = "jaw"; }, "/landmarks/0/handle"},
        BadJson{"SkewHeadFrame", [](Json* j) { Ours(j)["head_frame"]["left"] = {1, 1, 0}; }, "head frame"},
        BadJson{"NoScale", [](Json* j) { Ours(j)["handles"][0]["pose"]["scale"] = 0; }, "scale"},
        BadJson{"LineBreakInTitle", [](Json* j) { Ours(j)["title"] = "a\nb"; }, "/title"},
        BadJson{"EscapeInLabel", [](Json* j) { Ours(j)["handles"][0]["label"] = "\x1b[2J"; }, "/handles/0/label"},
        BadJson{"LongTitle", [](Json* j) { Ours(j)["title"] = std::string(5000, 'x'); }, "/title"},
        BadJson{"ManyHandles", [](Json* j) { for (int k = 0; k < 40; ++k) Ours(j)["handles"].push_back(Ours(j)["handles"][0]); }, "/handles"},
        BadJson{"TwoBuffers", [](Json* j) { (*j)["buffers"].push_back({{"byteLength", 1}}); }, "/buffers"},
        BadJson{"BufferElsewhere", [](Json* j) { (*j)["buffers"][0]["uri"] = "https://example.org/x"; }, "one buffer"},
        BadJson{"LongBuffer", [](Json* j) { (*j)["buffers"][0]["byteLength"] = 2147483648U; }, "/buffers/0/byteLength"},
        BadJson{"ViewPastTheEnd", [](Json* j) { (*j)["bufferViews"][0]["byteLength"] = 1000000000; }, "/bufferViews/0/byteLength"},
        BadJson{"ViewFromPastTheEnd", [](Json* j) { (*j)["bufferViews"][1]["byteOffset"] = 18446744073709551600U; }, "/bufferViews/1/byteOffset"},
        BadJson{"ViewBeforeTheBeginning", [](Json* j) { (*j)["bufferViews"][1]["byteOffset"] = -16; }, "/bufferViews/1/byteOffset"},
        BadJson{"ViewOutOfStep", [](Json* j) { (*j)["bufferViews"][1]["byteOffset"] = 8; (*j)["bufferViews"][1]["byteLength"] = 8; }, "multiple of 16"},
        BadJson{"ViewWithAStride", [](Json* j) { (*j)["bufferViews"][0]["byteStride"] = 12; }, "stride"},
        BadJson{"ViewOfText", [](Json* j) { (*j)["bufferViews"][0]["byteLength"] = "12"; }, "/bufferViews/0/byteLength"},
        BadJson{"ViewsAreNone", [](Json* j) { (*j)["bufferViews"] = 3; }, "/bufferViews"},
        BadJson{"MorePositionsThanBytes", [](Json* j) { (*j)["accessors"][0]["count"] = 2147483647; }, "bytes where"},
        BadJson{"MoreIndicesThanBytes", [](Json* j) { (*j)["accessors"][1]["count"] = 3000; }, "bytes where"},
        BadJson{"HalfATriangle", [](Json* j) { (*j)["accessors"][1]["count"] = 4; }, "do not form triangles"},
        BadJson{"OtherNumbers", [](Json* j) { (*j)["accessors"][1]["componentType"] = 5123; }, "/accessors/1/componentType"},
        BadJson{"SparsePositions", [](Json* j) { (*j)["accessors"][0]["sparse"] = Json::object(); }, "/accessors/0"},
        BadJson{"AccessorThatIsNot", [](Json* j) { (*j)["meshes"][0]["primitives"][0]["indices"] = 99; }, "/indices"},
        BadJson{"LinesInsteadOfTriangles", [](Json* j) { (*j)["meshes"][0]["primitives"][0]["mode"] = 1; }, "of triangles"},
        BadJson{"NoAttributes", [](Json* j) { (*j)["meshes"][0]["primitives"][0].erase("attributes"); }, "of triangles"},
        BadJson{"RegionsOfAnother", [](Json* j) { Ours(j)["surfaces"][0]["regions"] = 0; }, "/surfaces/0/regions"},
        BadJson{"FollowsOfAnother", [](Json* j) { Ours(j)["surfaces"][0]["follows"]["weights"] = 0; Ours(j)["surfaces"][0]["follows"]["vertices"] = 1; }, "/surfaces/0/follows"}),
    [](const auto& named) { return std::string(named.param.name); });

TEST(BadCaseTest, TheSampleIsGood) { EXPECT_THAT(ParseCase(GoodCase()), IsOk()); }

TEST(BadCaseTest, AFileThatIsCutOffAnywhereIsRefused) {
  for (size_t size = 0; size < GoodCase().size(); size += 1 + size / 20) {
    EXPECT_THAT(ParseCase(GoodCase().substr(0, size)), Not(IsOk())) << size;
  }
}

TEST(BadCaseTest, DataAfterTheEndIsRefused) {
  EXPECT_THAT(ParseCase(GoodCase() + "more"), StatusIs(kInvalid, HasSubstr("and has")));
  std::string longer = GoodCase() + "more";
  SetWord(&longer, 8, static_cast<uint32_t>(longer.size()));
  EXPECT_THAT(ParseCase(longer), StatusIs(kInvalid, HasSubstr("data after its BIN chunk")));
}

// Of any bytes: a case that can be written again, or a refusal in one line.
TEST(BadCaseTest, RandomDamageIsRefusedOrHarmless) {
  std::mt19937 random(11);
  int refused = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    std::string damaged = GoodCase();
    // Half of it in the JSON, which says where everything is.
    const size_t within = trial % 2 == 0 ? 20 + WordAt(damaged, 12) : damaged.size();
    for (int change = 0; change <= trial % 4; ++change) {
      damaged[random() % within] = static_cast<char>(random());
    }
    const absl::StatusOr<CaseFile> read = ParseCase(damaged);
    if (read.ok()) {
      EXPECT_THAT(SerializeCase(*read), IsOk());
    } else {
      ++refused;
      EXPECT_THAT(std::string(read.status().message()), Not(HasSubstr("\n")));
    }
  }
  EXPECT_GT(refused, 1000);
}

TEST(BadCaseTest, RefusesOtherFiles) {
  EXPECT_THAT(ParseCase(""), StatusIs(kInvalid, HasSubstr("glTF")));
  EXPECT_THAT(ParseCase("solid stl\nendsolid\n"), StatusIs(kInvalid, HasSubstr("glTF")));
  EXPECT_THAT(ReadCase("/no/such.tfcase"), StatusIs(absl::StatusCode::kNotFound));
}

TEST(BadCaseTest, RefusesAMeshThatDoesNotMatchItsName) {
  const Glb glb = *ParseGlb(GoodCase(), kMaxCaseJsonBytes);
  const std::string changed =
      WithView(glb.views.size() - 1, [](char* bytes, size_t size) { bytes[size / 2] ^= 1; });
  EXPECT_THAT(ParseCase(changed), StatusIs(absl::StatusCode::kDataLoss));
}

TEST(BadCaseTest, JsonOverTheLimitIsNotRead) {
  const std::string changed =
      WithJson([](Json* j) { (*j)["asset"]["copyright"] = std::string(kMaxCaseJsonBytes, 'x'); });
  EXPECT_THAT(ParseCase(changed), StatusIs(absl::StatusCode::kResourceExhausted));
}

// Nothing is allocated for triangles that the file only says.
TEST(BadCaseTest, ASurfaceOfTwoGigabytesIsNotRead) {
  const std::string changed = WithJson([](Json* j) { (*j)["accessors"][1]["count"] = 536870913; });
  EXPECT_THAT(ParseCase(changed),
              StatusIs(absl::StatusCode::kResourceExhausted, HasSubstr("triangles")));
}

class BadBytesTest : public ::testing::Test {
 protected:
  // Of the sample's buffer views: two for each of two surfaces, then what the skin follows.
  static constexpr size_t kPositions = 0;
  static constexpr size_t kTriangles = 1;
  static constexpr size_t kVertices = 4;
  static constexpr size_t kWeights = 5;

  static absl::StatusOr<CaseFile> ParseWithFloat(size_t view, float value) {
    return ParseCase(
        WithView(view, [&](char* bytes, size_t) { std::memcpy(bytes + 8, &value, 4); }));
  }
  static absl::StatusOr<CaseFile> ParseWithNumber(size_t view, int32_t value) {
    return ParseCase(
        WithView(view, [&](char* bytes, size_t) { std::memcpy(bytes + 8, &value, 4); }));
  }
};

TEST_F(BadBytesTest, PositionsAreFinite) {
  EXPECT_THAT(ParseWithFloat(kPositions, std::nanf("")), StatusIs(kInvalid, HasSubstr("NaN")));
  EXPECT_THAT(ParseWithFloat(kPositions, INFINITY), StatusIs(kInvalid, HasSubstr("NaN")));
}

TEST_F(BadBytesTest, TrianglesHaveVerticesOfTheirSurface) {
  EXPECT_THAT(ParseWithNumber(kTriangles, 10000), StatusIs(kInvalid, HasSubstr("/surfaces/0")));
  EXPECT_THAT(ParseWithNumber(kTriangles, -1), StatusIs(kInvalid, HasSubstr("/surfaces/0")));
}

TEST_F(BadBytesTest, FollowedVerticesAreThoseOfTheMesh) {
  EXPECT_THAT(ParseWithNumber(kVertices, 45), StatusIs(kInvalid, HasSubstr("/follows/vertices")));
  EXPECT_THAT(ParseWithNumber(kVertices, -1), StatusIs(kInvalid, HasSubstr("/follows/vertices")));
}

TEST_F(BadBytesTest, WeightsAreSharesOfAMovement) {
  EXPECT_THAT(ParseWithFloat(kWeights, -0.5F), StatusIs(kInvalid, HasSubstr("/follows/weights")));
  EXPECT_THAT(ParseWithFloat(kWeights, 0.5F), StatusIs(kInvalid, HasSubstr("/follows/weights")));
  EXPECT_THAT(ParseWithFloat(kWeights, std::nanf("")),
              StatusIs(kInvalid, HasSubstr("/follows/weights")));
}

}  // namespace
}  // namespace tissueform
