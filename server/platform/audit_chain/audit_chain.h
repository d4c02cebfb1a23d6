// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/strings/string_view.h"

#include "server/platform/audit_chain/audit_key.h"

// The form of an audit log: files of JSON objects, one a line, each sealed to the one before.
//
//   {"n":17,"event":"call",...,"mac":"<64 hexadecimal digits>"}
//
// n rises by one from line to line, over all files. mac is HMAC-SHA-256, by the log's key, of the
// mac of the line before followed by this line up to, but without, `,"mac":`. So no line can be
// changed, taken out, put in or moved without the key. The first line of a file repeats the last
// mac of the file before (of the first file: 64 noughts), so that each can be verified by itself:
//
//   {"n":40,"event":"begin","file":2,"key":"<AuditKey::Id>","previous":"<mac of line 39>",...}
namespace tissueform {

// Longer lines are none of a log's.
inline constexpr size_t kMaxAuditLineBytes = 8192;

// Where a log is.
struct AuditPosition {
  uint64_t number = 0;  // of its last line
  std::string mac = std::string(64, '0');
  uint64_t file = 0;

  friend bool operator==(const AuditPosition&, const AuditPosition&) = default;
};

// A line taken apart: views into it.
struct AuditLine {
  uint64_t number = 0;
  absl::string_view body;  // what is sealed
  absl::string_view mac;
};
// Nothing when it has not the form of a line. Whether it is sealed is another question. `line`
// comes without its line feed.
std::optional<AuditLine> ParseAuditLine(absl::string_view line);

// Whether it follows the line that has this mac.
bool IsSealed(const AuditLine& line, absl::string_view previous_mac, const AuditKey& key);

// What the first line of a file says.
struct AuditFileHead {
  uint64_t file = 0;
  std::string key_id;
  std::string previous;
};
// Nothing where it is no first line.
std::optional<AuditFileHead> ParseAuditFileHead(const AuditLine& line);

// Makes the lines that follow a position. One thread at a time.
class AuditChain {
 public:
  AuditChain(AuditKey key, AuditPosition position);

  // The next line, with its line feed. `members` is the inside of a JSON object, not empty.
  std::string Seal(absl::string_view members);
  // The first line of the next file. `members` as above, or empty.
  std::string SealHead(absl::string_view members);

  const AuditPosition& position() const { return position_; }
  // Lines that could not be written never were.
  void GoBackTo(AuditPosition position) { position_ = std::move(position); }

 private:
  const AuditKey key_;
  AuditPosition position_;
};

// What is told elsewhere of a log, so that its end cannot be cut off in silence.
struct AuditCheckpoint {
  uint64_t number = 0;
  std::string mac;
};
// "tissueform-audit checkpoint n=17 mac=...".
std::string CheckpointText(const AuditPosition& position);
// Out of a line that may begin with what a system log puts before it; nothing when it holds none.
std::optional<AuditCheckpoint> ParseCheckpoint(absl::string_view line);

}  // namespace tissueform
