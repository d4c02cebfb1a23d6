// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/log_lines.h"

#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "spdlog/sinks/ostream_sink.h"
#include "spdlog/spdlog.h"

namespace tissueform {
namespace {

class LogLinesTest : public ::testing::Test {
 protected:
  LogLinesTest() : logger_("program", std::make_shared<spdlog::sinks::ostream_sink_st>(text_)) {
    logger_.set_formatter(MakeJsonLines());
  }

  // Every line by itself.
  std::vector<nlohmann::json> Lines() {
    std::vector<nlohmann::json> lines;
    for (std::string line; std::getline(text_, line);) lines.push_back(nlohmann::json::parse(line));
    return lines;
  }

  std::stringstream text_;
  spdlog::logger logger_;
};

TEST_F(LogLinesTest, AMessageIsOneObjectOnOneLineWhateverItHolds) {
  logger_.warn("quotes \" and\nfeeds \\ and \xff no UTF-8 {}", 7);
  const auto lines = Lines();
  ASSERT_EQ(lines.size(), 1);
  EXPECT_EQ(lines[0].at("message"), "quotes \" and\nfeeds \\ and \xEF\xBF\xBD no UTF-8 7");
  EXPECT_EQ(lines[0].at("level"), "warning");
  EXPECT_EQ(lines[0].at("logger"), "program");
  const auto time = lines[0].at("time").get<std::string>();
  EXPECT_EQ(time.size(), std::string("2026-11-23T17:00:00.000000Z").size());
  EXPECT_EQ(time.back(), 'Z');
  EXPECT_FALSE(lines[0].contains("method"));
}

TEST_F(LogLinesTest, LinesOfACallHaveItsFieldsAndOthersHaveNone) {
  {
    const CallOfLogLine call = {.request_id = "r-1",
                                .method = "MeshService.GetMesh",
                                .code = "OK",
                                .duration = std::chrono::milliseconds(3),
                                .traceparent = "00-trace"};
    const LogLinesOfCall lines(call);
    logger_.info("done");
  }
  const CallOfLogLine under_way = {
      .request_id = "r-2", .method = "MeshService.GetMesh", .code = "", .traceparent = ""};
  {
    const LogLinesOfCall lines(under_way);
    logger_.info("begun");
  }
  logger_.info("other");
  const auto lines = Lines();
  ASSERT_EQ(lines.size(), 3);
  EXPECT_EQ(lines[0].at("request_id"), "r-1");
  EXPECT_EQ(lines[0].at("method"), "MeshService.GetMesh");
  EXPECT_EQ(lines[0].at("code"), "OK");
  EXPECT_EQ(lines[0].at("duration_ms"), 3.0);
  EXPECT_EQ(lines[0].at("traceparent"), "00-trace");
  EXPECT_EQ(lines[1].at("request_id"), "r-2");
  EXPECT_FALSE(lines[1].contains("code"));
  EXPECT_FALSE(lines[1].contains("traceparent"));
  EXPECT_FALSE(lines[2].contains("request_id"));
}

}  // namespace
}  // namespace tissueform
