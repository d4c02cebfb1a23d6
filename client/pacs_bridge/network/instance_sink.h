// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"

#include "client/pacs_bridge/dicom/instance_header.h"

namespace tissueform {

// An object that has come from a PACS or a scanner, as a file that is whole and on the disk.
struct ReceivedInstance {
  enum class Novelty {
    kNew,
    kReplayed,  // this object was there with the same bytes; `path` is the file that was there
    kChanged,   // it was there with other bytes; `path` is a file of its own
  };

  std::string path = {};  // PS3.10; the data set to the last bit as it came, in any transfer syntax
  InstanceHeader header = {};
  Novelty novelty = Novelty::kNew;
  int64_t bytes = 0;
  std::string calling_ae = {};  // who has sent it; of DICOMweb the peer's name
  std::string address = {};     // from where, without the port
  int64_t association = 0;      // all that comes in one association (or fetch) has its number
};

// An association (or fetch) that has ended.
struct EndedAssociation {
  int64_t association = 0;
  std::string calling_ae = {};
  std::string address = {};
  int kept = 0;
  int refused = 0;
  bool released = false;     // false: aborted, timed out or broken off
  std::string problem = {};  // one line without patient data; empty: none
};

// A connection, or a request for an association, that was refused.
struct RefusedConnection {
  std::string address = {};     // from where, without the port
  std::string calling_ae = {};  // as the other side states it; empty: it has stated none
  std::string reason = {};      // one line without text from outside
};

// Takes what is received. Threads: called from many at once. The instances of one association may
// belong to several patients, studies or series.
class InstanceSink {
 public:
  virtual ~InstanceSink() = default;

  // Called when the file is durable and before the sender gets its answer: after OK the file is
  // kept for good, and the sender forgets it. Otherwise the file goes, unless it was there before,
  // and the sender gets: ResourceExhausted 0xA700 (out of resources: it tries again), AlreadyExists
  // 0x0111 (duplicate), InvalidArgument 0xC000 (cannot understand), else 0x0110 (failure).
  virtual absl::Status Keep(const ReceivedInstance& instance) = 0;

  // Once an association, also when nothing came in it; not for those that were refused.
  virtual void AssociationEnded(const EndedAssociation& ended) = 0;

  // Called for each refusal, however many come; must not block.
  virtual void ConnectionRefused(const RefusedConnection& /*refused*/) {}
};

}  // namespace tissueform
