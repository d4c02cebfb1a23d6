// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/log_lines.h"

#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "nlohmann/json.hpp"
#include "spdlog/spdlog.h"

namespace tissueform {
namespace {

thread_local const CallOfLogLine* call_of_line = nullptr;

class JsonLines final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    nlohmann::ordered_json object;
    object["time"] = absl::FormatTime("%Y-%m-%d%ET%H:%M:%E6SZ", absl::FromChrono(message.time),
                                      absl::UTCTimeZone());
    object["level"] = ToText(spdlog::level::to_string_view(message.level));
    object["logger"] = ToText(message.logger_name);
    object["message"] = ToText(message.payload);
    if (call_of_line != nullptr) AddCall(*call_of_line, &object);
    const std::string text =
        object.dump(-1, ' ', /*ensure_ascii=*/false, nlohmann::json::error_handler_t::replace);
    out.append(text.data(), text.data() + text.size());
    out.push_back('\n');
  }

  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<JsonLines>();
  }

 private:
  static std::string ToText(spdlog::string_view_t view) { return {view.data(), view.size()}; }

  static void AddCall(const CallOfLogLine& call, nlohmann::ordered_json* object) {
    (*object)["request_id"] = call.request_id;
    (*object)["method"] = call.method;
    if (!call.code.empty()) {
      (*object)["code"] = call.code;
      (*object)["duration_ms"] = call.duration.count();
    }
    if (!call.traceparent.empty()) (*object)["traceparent"] = call.traceparent;
  }
};

}  // namespace

LogLinesOfCall::LogLinesOfCall(const CallOfLogLine& call) { call_of_line = &call; }
LogLinesOfCall::~LogLinesOfCall() { call_of_line = nullptr; }

std::unique_ptr<spdlog::formatter> MakeJsonLines() { return std::make_unique<JsonLines>(); }

void SetLogFormat(const std::string& format) {
  if (format == "json") spdlog::set_formatter(MakeJsonLines());
}

}  // namespace tissueform
