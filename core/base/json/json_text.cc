// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/json/json_text.h"

#include <algorithm>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "nlohmann/json.hpp"

namespace tissueform {
namespace {

using Json = nlohmann::json;

std::string LineAndColumn(const std::string& text, size_t position) {
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(position, text.size()));
  const auto line = 1 + std::count(text.begin(), end, '\n');
  const auto line_start = std::find(std::make_reverse_iterator(end), text.rend(), '\n').base();
  return absl::StrCat("line ", line, ", column ", end - line_start);
}

// Walks over a text without building anything and stops at the first thing that is not allowed.
class StrictnessCheck : public nlohmann::json_sax<Json> {
 public:
  explicit StrictnessCheck(const std::string& text) : text_(text) {}

  const absl::Status& status() const { return status_; }

  bool null() override { return Value(); }
  bool boolean(bool) override { return Value(); }
  bool number_integer(number_integer_t) override { return Value(); }
  bool number_unsigned(number_unsigned_t) override { return Value(); }
  bool number_float(number_float_t, const string_t&) override { return Value(); }
  bool string(string_t&) override { return Value(); }
  bool binary(binary_t&) override { return Value(); }
  bool start_object(size_t) override { return Open(/*is_array=*/false); }
  bool end_object() override { return Close(); }
  bool start_array(size_t) override { return Open(/*is_array=*/true); }
  bool end_array() override { return Close(); }

  bool key(string_t& key) override {
    if (key.size() > kMaxJsonKeyBytes) {
      return Refuse(absl::StrCat("a key of ", key.size(), " bytes at ", Pointer(levels_.size() - 1),
                                 "; at most ", kMaxJsonKeyBytes, " are read"));
    }
    Level& level = levels_.back();
    level.key = key;
    if (level.keys.insert(key).second) return true;
    return Refuse(absl::StrCat("key \"", key, "\" appears twice at ", Pointer(levels_.size() - 1),
                               "; keep one of them"));
  }

  bool parse_error(size_t position, const std::string& last_token,
                   const nlohmann::detail::exception&) override {
    return Refuse(absl::StrCat("not valid JSON at ", LineAndColumn(text_, position), ", near '",
                               last_token.substr(0, 40), "'"));
  }

 private:
  struct Level {
    bool is_array = false;
    size_t index = 0;
    std::string key;
    std::set<std::string> keys;
  };

  bool Refuse(const std::string& message) {
    status_ = absl::InvalidArgumentError(message);
    return false;
  }

  bool Value() {
    if (!levels_.empty()) ++levels_.back().index;
    return true;
  }

  bool Open(bool is_array) {
    if (levels_.size() >= kMaxJsonDepth) {
      return Refuse(absl::StrCat("nested deeper than ", kMaxJsonDepth, " levels"));
    }
    levels_.push_back({.is_array = is_array, .index = 0, .key = {}, .keys = {}});
    return true;
  }

  bool Close() {
    levels_.pop_back();
    return Value();
  }

  std::string Pointer(size_t depth) const {
    std::vector<std::string> path;
    for (size_t i = 0; i < depth; ++i) {
      path.push_back(levels_[i].is_array ? absl::StrCat(levels_[i].index) : levels_[i].key);
    }
    return JsonPointer(path);
  }

  const std::string& text_;
  std::vector<Level> levels_;
  absl::Status status_;
};

}  // namespace

std::string JsonPointer(const std::vector<std::string>& path) {
  std::string pointer;
  for (const std::string& step : path) {
    pointer += '/';
    pointer += absl::StrReplaceAll(step, {{"~", "~0"}, {"/", "~1"}});
  }
  return pointer.empty() ? "/" : pointer;
}

absl::StatusOr<Json> ParseJsonStrictly(const std::string& text) {
  // The library takes a zero byte for the end and would not look at what follows.
  if (const size_t zero = text.find('\0'); zero != std::string::npos) {
    return absl::InvalidArgumentError(
        absl::StrCat("not valid JSON at ", LineAndColumn(text, zero), ": a zero byte"));
  }
  StrictnessCheck check(text);
  try {
    if (!Json::sax_parse(text, &check)) return check.status();
    return Json::parse(text);
  } catch (const std::exception& exception) {
    return absl::InvalidArgumentError(absl::StrCat("not valid JSON: ", exception.what()));
  }
}

}  // namespace tissueform
