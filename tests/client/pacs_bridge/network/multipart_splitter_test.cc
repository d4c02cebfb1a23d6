// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/network/multipart_splitter.h"

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kType[] = "multipart/related; type=\"application/dicom\"; boundary=\"cut here\"";

// The parts of a body that comes in pieces of one size.
absl::StatusOr<std::vector<std::string>> Split(const std::string& body, size_t piece,
                                               const std::string& type = kType) {
  std::vector<std::string> parts;
  MultipartSplitter::Events events;
  events.begin = [&] {
    parts.emplace_back();
    return absl::OkStatus();
  };
  events.data = [&](absl::string_view bytes) {
    absl::StrAppend(&parts.back(), bytes);
    return absl::OkStatus();
  };
  events.end = [&] {
    parts.back() += "|";
    return absl::OkStatus();
  };
  auto splitter = MultipartSplitter::Create(type, events);
  if (!splitter.ok()) return splitter.status();
  for (size_t at = 0; at < body.size(); at += piece) {
    const absl::Status taken = splitter->Take(absl::string_view(body).substr(at, piece));
    if (!taken.ok()) return taken;
  }
  const absl::Status finished = splitter->Finish();
  if (!finished.ok()) return finished;
  return parts;
}

TEST(MultipartSplitter, PartsAreTheSameInPiecesOfAnySize) {
  const std::string body = absl::StrCat(
      "a preamble\r\n--cut here\r\nContent-Type: application/dicom\r\n\r\nfirst\r\n--cut her",
      std::string("\0\r\n-", 4), "\r\n--cut here\r\nA: b\r\n\r\n\r\n--cut here\r\n\r\nthird",
      "\r\n--cut here--\r\nan epilogue");
  for (size_t piece = 1; piece <= body.size(); ++piece) {
    const auto parts = Split(body, piece);
    ASSERT_THAT(parts.status(), IsOk()) << piece;
    EXPECT_THAT(*parts, ElementsAre(std::string("first\r\n--cut her\0\r\n-|", 21), "|", "third|"))
        << piece;
  }
}

TEST(MultipartSplitter, TruncatedBodyIsReported) {
  for (const std::string& body :
       {std::string(), std::string("--cut here\r\n\r\nhalf a part"),
        std::string("--cut here\r\n\r\nwhole\r\n--cut here"), std::string("no boundary")}) {
    EXPECT_THAT(Split(body, 3).status(), StatusIs(absl::StatusCode::kInvalidArgument,
                                                  HasSubstr("before its last boundary")));
  }
}

TEST(MultipartSplitter, EndlessHeadersAndLinesAreRefused) {
  EXPECT_THAT(Split("--cut here\r\n" + std::string(20'000, 'x'), 100).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("too many headers")));
  EXPECT_THAT(Split("--cut here" + std::string(20'000, 'x'), 100).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("line is too long")));
}

TEST(MultipartSplitter, OtherTypesAndBoundariesAreRefused) {
  EXPECT_THAT(Split("", 1, "application/json").status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("another type")));
  for (const std::string& type :
       {std::string("multipart/related"), std::string("multipart/related; boundary=\"\""),
        absl::StrCat("multipart/related; boundary=", std::string(71, 'b'))}) {
    EXPECT_THAT(Split("", 1, type).status(),
                StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("no boundary")));
  }
}

}  // namespace
}  // namespace tissueform::testing
