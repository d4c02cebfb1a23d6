// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/answer_evaluator/answer_bytes.h"

#include <cstring>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/core/mechanics/answer_evaluator/evaluated_problem.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr size_t kHeadBytes = 16;
constexpr size_t kEntryBytes = 16;

class AnswerBytesTest : public ::testing::TestWithParam<Evaluated> {
 protected:
  AnswerBytesTest() {
    const auto preparation = PrepareEvaluated(Bar({3, 6, 6}, 2.0, 0.2), GetParam());
    bytes_ = WriteAnswers((*CreateResponse(preparation, AllVertices(preparation->mesh()),
                                           {.model = GetParam().model}))
                              ->Describe());
  }

  template <typename Value>
  void Put(size_t offset, Value value) {
    std::memcpy(bytes_.data() + offset, &value, sizeof(value));
  }

  std::string bytes_;
};

TEST_P(AnswerBytesTest, RoundTripAndAreAligned) {
  const AnswerReading reading = ReadAnswers(bytes_);
  ASSERT_EQ(reading.error, AnswerError::kNone) << reading.message;
  EXPECT_EQ(reading.message, "");
  EXPECT_EQ(WriteAnswers(reading.answers), bytes_);
  EXPECT_EQ(bytes_.size() % 16, 0U);
  EXPECT_EQ(bytes_.substr(0, 8), "TFANSWER");
}

TEST_P(AnswerBytesTest, TruncatedOrExtendedBytesAreRefused) {
  for (size_t size = 0; size < bytes_.size(); size += size < 1000 ? 1 : 997) {
    const AnswerReading reading = ReadAnswers(bytes_.substr(0, size));
    EXPECT_NE(reading.error, AnswerError::kNone) << size;
    EXPECT_NE(reading.message, "") << size;
    EXPECT_TRUE(reading.answers.regions.empty()) << size;
  }
  EXPECT_EQ(ReadAnswers(bytes_ + std::string(16, '\0')).error, AnswerError::kBroken);
}

TEST_P(AnswerBytesTest, ErrorsNameTheirCause) {
  EXPECT_EQ(ReadAnswers("").error, AnswerError::kNotAnswers);
  EXPECT_EQ(ReadAnswers(bytes_, bytes_.size()).error, AnswerError::kNone);
  AnswerReading reading = ReadAnswers(bytes_, bytes_.size() - 1);
  EXPECT_EQ(reading.error, AnswerError::kTooLarge);
  EXPECT_THAT(reading.message, HasSubstr("at most"));
  const std::string good = bytes_;
  for (const uint32_t version : {0U, 5U}) {
    Put(8, version);
    reading = ReadAnswers(bytes_);
    EXPECT_EQ(reading.error, AnswerError::kVersion);
    EXPECT_THAT(reading.message, HasSubstr("version " + std::to_string(version)));
  }
  bytes_ = good;
  bytes_[0] = 'X';
  EXPECT_EQ(ReadAnswers(bytes_).error, AnswerError::kNotAnswers);
}

// Readers of earlier versions pass over the sections of a third order or of contact, and would
// answer by the others alone.
TEST_P(AnswerBytesTest, StateTheLowestVersionThatSupportsThem) {
  EXPECT_EQ(bytes_[8], static_cast<char>(GetParam().version));
  for (uint32_t version = 1; version <= kAnswerFormatVersion; ++version) {
    Put(8, version);
    EXPECT_EQ(ReadAnswers(bytes_).error,
              version < GetParam().version ? AnswerError::kInconsistent : AnswerError::kNone);
  }
}

// Of the second section: number, type, offset, count.
TEST_P(AnswerBytesTest, InconsistentTableIsRefused) {
  const size_t entry = kHeadBytes + kEntryBytes;
  const std::string good = bytes_;
  for (const auto& [at, value] : std::vector<std::pair<size_t, uint32_t>>{
           {12, 0xffffffff},          // sections
           {12, 1001},                //
           {entry, 1},                // twice the same
           {entry + 4, 0},            // no type
           {entry + 4, 5},            //
           {entry + 4, 1},            // another one
           {entry + 8, 0},            // over the table
           {entry + 8, 8},            // not aligned
           {entry + 8, 0xfffffff0},   // beyond the end
           {entry + 12, 0xffffffff},  //
           {entry + 12, 0},           // less than the others state
       }) {
    bytes_ = good;
    Put(at, value);
    EXPECT_NE(ReadAnswers(bytes_).error, AnswerError::kNone) << at << ", " << value;
  }
}

TEST_P(AnswerBytesTest, SectionsOfLaterReleasesArePassedOver) {
  // One entry more, for 16 bytes at the end; all others lie 16 bytes farther.
  std::string longer = bytes_;
  const size_t sections = static_cast<uint8_t>(bytes_[12]);
  for (size_t i = 0; i < sections; ++i) {
    uint32_t at = 0;
    std::memcpy(&at, longer.data() + kHeadBytes + kEntryBytes * i + 8, sizeof(at));
    at += kEntryBytes;
    std::memcpy(longer.data() + kHeadBytes + kEntryBytes * i + 8, &at, sizeof(at));
  }
  const uint32_t added[] = {999, 4, static_cast<uint32_t>(bytes_.size() + kEntryBytes), 8};
  longer.insert(kHeadBytes + kEntryBytes * sections,
                std::string(reinterpret_cast<const char*>(added), sizeof(added)));
  longer += std::string(16, '\1');
  longer[12] = static_cast<char>(sections + 1);
  const AnswerReading reading = ReadAnswers(longer);
  ASSERT_EQ(reading.error, AnswerError::kNone) << reading.message;
  EXPECT_EQ(WriteAnswers(reading.answers), bytes_);
}

INSTANTIATE_TEST_SUITE_P(Models, AnswerBytesTest, ::testing::ValuesIn(EvaluatedModels()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace tissueform::testing
