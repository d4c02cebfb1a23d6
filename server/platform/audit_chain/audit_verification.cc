// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit_chain/audit_verification.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr std::array<absl::string_view, 7> kFaultNames = {
    "changed", "removed", "inserted", "out of order", "cut", "missing file", "wrong key"};

absl::StatusOr<std::ifstream> OpenToRead(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  // A folder opens, and fails when it is read.
  if (!stream || (stream.peek(), stream.bad())) {
    return absl::NotFoundError(absl::StrCat(path, ": cannot be read (", std::strerror(errno), ")"));
  }
  stream.clear();
  return stream;
}

// A line as it lies there; what is too long for one is cut, and so has not its form.
struct RawLine {
  std::string text;
  bool ends = false;  // in a line feed
};

bool Next(std::ifstream* stream, RawLine* line) {
  std::array<char, kMaxAuditLineBytes + 2> buffer = {};
  stream->getline(buffer.data(), buffer.size());
  const auto count = static_cast<size_t>(stream->gcount());
  if (count == 0) return false;
  line->ends = !stream->eof();
  line->text.assign(buffer.data(), stream->fail() || !line->ends ? count : count - 1);
  if (stream->fail() && !stream->eof()) {
    stream->clear();
    stream->ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return true;
}

std::string Lines(uint64_t first, uint64_t last) {
  return first == last ? absl::StrCat("line n=", first, " is")
                       : absl::StrCat("lines n=", first, " to n=", last, " are");
}

// What the rest of a file says about a line that does not fit.
struct Rest {
  bool has_expected_number = false;
  bool has_same_number = false;
  bool follows_last_good = false;  // a later line is sealed to the last good one
  bool any_sealed = false;         // to the line before it: the key is right
  std::optional<uint64_t>
      follower;  // the next line, when it is sealed to the one that does not fit
};

class Verification {
 public:
  Verification(const AuditKey& key, const std::vector<AuditCheckpoint>& checkpoints) : key_(key) {
    for (const AuditCheckpoint& checkpoint : checkpoints) {
      checkpoints_.insert_or_assign(checkpoint.number, checkpoint.mac);
    }
  }

  // False when something was found.
  bool Read(const std::string& path, std::ifstream* stream) {
    path_ = path;
    line_ = 0;
    ++report_.files;
    for (RawLine raw; Next(stream, &raw);) {
      ++line_;
      if (!Take(raw, stream)) return false;
    }
    return line_ > 0 || Found(AuditFault::kCut, "the file is empty");
  }

  void CompareEnd() {
    const auto beyond = checkpoints_.upper_bound(report_.last.number);
    if (beyond == checkpoints_.end()) return;
    Found(AuditFault::kCut,
          absl::StrCat("the log ends with line n=", report_.last.number,
                       ", but a checkpoint names line n=", checkpoints_.rbegin()->first));
  }

  AuditReport report() && { return std::move(report_); }

 private:
  bool Found(AuditFault fault, std::string what) {
    report_.finding = {.fault = fault, .file = path_, .line = line_, .what = std::move(what)};
    return false;
  }

  bool Take(const RawLine& raw, std::ifstream* stream) {
    const std::optional<AuditLine> line = ParseAuditLine(raw.text);
    if (!raw.ends)
      return Found(AuditFault::kCut, "the line is incomplete; the file was truncated here");
    if (line_ == 1) return line.has_value() ? TakeFirst(*line, stream) : Unreadable(stream);
    if (!line.has_value()) return Unreadable(stream);
    if (line->number == report_.last.number + 1 && IsSealed(*line, report_.last.mac, key_)) {
      return Accept(*line);
    }
    return Misfit(*line, stream);
  }

  bool Unreadable(std::ifstream* stream) {
    const Rest rest = ReadRest(stream, "");
    if (line_ > 1 && rest.follows_last_good) {
      return Found(AuditFault::kInserted, "this is not a line of the log");
    }
    return Found(AuditFault::kChanged, "this does not have the form of a line");
  }

  bool Misfit(const AuditLine& line, std::ifstream* stream) {
    const uint64_t expected = report_.last.number + 1;
    const uint64_t number = line.number;
    const Rest rest = ReadRest(stream, std::string(line.mac), number);
    if (rest.follower == expected + 1) {
      return Found(AuditFault::kChanged, absl::StrCat("line n=", expected, " was changed"));
    }
    if (number < expected) {
      return Found(AuditFault::kInserted, absl::StrCat("line n=", number, " is repeated here"));
    }
    // A line that was moved here stands at no other place.
    if (rest.follows_last_good && (number == expected || rest.has_same_number)) {
      return Found(AuditFault::kInserted,
                   absl::StrCat("this line n=", number, " was not written by the server"));
    }
    if (number == expected) {
      return Found(AuditFault::kChanged, absl::StrCat("line n=", number, " was changed"));
    }
    if (rest.has_expected_number) {
      return Found(AuditFault::kOutOfOrder,
                   absl::StrCat("line n=", number, " comes before line n=", expected));
    }
    return Found(AuditFault::kRemoved, absl::StrCat(Lines(expected, number - 1), " missing"));
  }

  bool TakeFirst(const AuditLine& line, std::ifstream* stream) {
    const std::optional<AuditFileHead> head = ParseAuditFileHead(line);
    if (!head.has_value()) {
      return Found(AuditFault::kRemoved, "the first line of the file is missing");
    }
    if (!IsSealed(line, head->previous, key_)) {
      const bool is_other_key =
          head->key_id != key_.Id() && !ReadRest(stream, std::string(line.mac)).any_sealed;
      return is_other_key
                 ? Found(AuditFault::kWrongKey,
                         absl::StrCat("the file was sealed with key ", head->key_id.substr(0, 16),
                                      ", this one is ", key_.Id()))
                 : Found(AuditFault::kChanged, "the first line was changed");
    }
    return FollowsFileBefore(line, *head) && Accept(line);
  }

  bool FollowsFileBefore(const AuditLine& line, const AuditFileHead& head) {
    const AuditPosition before = report_.last;
    report_.last.file = head.file;
    if (report_.lines == 0) {
      report_.first = line.number;
      return true;
    }
    if (head.file <= before.file) {
      return Found(AuditFault::kInserted, absl::StrCat("file ", head.file, " comes again"));
    }
    if (head.file > before.file + 1) {
      return Found(AuditFault::kMissingFile,
                   absl::StrCat("this is file ", head.file,
                                " of the log, the one before it is file ", before.file));
    }
    if (line.number == before.number + 1 && head.previous == before.mac) return true;
    return Found(AuditFault::kCut, absl::StrCat("the file before ends with line n=", before.number,
                                                ", this one begins with line n=", line.number));
  }

  bool Accept(const AuditLine& line) {
    report_.last.number = line.number;
    report_.last.mac = std::string(line.mac);
    const auto checkpoint = checkpoints_.find(line.number);
    if (checkpoint != checkpoints_.end() && checkpoint->second != line.mac) {
      return Found(AuditFault::kChanged, absl::StrCat("line n=", line.number,
                                                      " does not match a checkpoint: "
                                                      "its author has the key"));
    }
    ++report_.lines;
    report_.mended += absl::StrContains(line.body, ",\"event\":\"mended\"") ? 1 : 0;
    report_.lost += absl::StrContains(line.body, ",\"event\":\"lost\"") ? 1 : 0;
    return true;
  }

  // After a line with this mac and number.
  Rest ReadRest(std::ifstream* stream, std::string mac, uint64_t number = 0) const {
    Rest rest;
    bool is_next = true;
    for (RawLine raw; Next(stream, &raw);) {
      const std::optional<AuditLine> line = ParseAuditLine(raw.text);
      if (!line.has_value()) continue;
      rest.has_same_number |= line->number == number;
      rest.has_expected_number |= line->number == report_.last.number + 1;
      rest.follows_last_good |= IsSealed(*line, report_.last.mac, key_);
      const bool sealed = IsSealed(*line, mac, key_);
      if (sealed && is_next) rest.follower = line->number;
      rest.any_sealed |= sealed;
      is_next = false;
      mac = std::string(line->mac);
    }
    return rest;
  }

  const AuditKey& key_;
  std::map<uint64_t, std::string> checkpoints_;
  std::string path_;
  int64_t line_ = 0;
  AuditReport report_;
};

// By the first line; what has none comes first, and is found to be wrong.
absl::StatusOr<uint64_t> FirstNumber(const std::string& path) {
  TF_ASSIGN_OR_RETURN(std::ifstream stream, OpenToRead(path));
  RawLine raw;
  if (!Next(&stream, &raw)) return 0;
  const std::optional<AuditLine> line = ParseAuditLine(raw.text);
  return line.has_value() ? line->number : 0;
}

}  // namespace

absl::string_view AuditFaultName(AuditFault fault) {
  return kFaultNames[static_cast<size_t>(fault)];
}

absl::StatusOr<AuditReport> VerifyAuditFiles(const std::vector<std::string>& paths,
                                             const AuditKey& key,
                                             const std::vector<AuditCheckpoint>& checkpoints) {
  if (paths.empty()) return absl::InvalidArgumentError("name a file of an audit log");
  std::vector<std::pair<uint64_t, std::string>> ordered;
  for (const std::string& path : paths) {
    TF_ASSIGN_OR_RETURN(const uint64_t number, FirstNumber(path));
    ordered.emplace_back(number, path);
  }
  std::sort(ordered.begin(), ordered.end());
  Verification verification(key, checkpoints);
  for (const auto& [number, path] : ordered) {
    TF_ASSIGN_OR_RETURN(std::ifstream stream, OpenToRead(path));
    if (!verification.Read(path, &stream)) return std::move(verification).report();
  }
  verification.CompareEnd();
  return std::move(verification).report();
}

absl::StatusOr<std::vector<AuditCheckpoint>> ReadCheckpoints(const std::string& path) {
  TF_ASSIGN_OR_RETURN(std::ifstream stream, OpenToRead(path));
  std::vector<AuditCheckpoint> checkpoints;
  for (RawLine raw; Next(&stream, &raw);) {
    if (const auto checkpoint = ParseCheckpoint(raw.text); checkpoint.has_value()) {
      checkpoints.push_back(*checkpoint);
    }
  }
  return checkpoints;
}

}  // namespace tissueform
