// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "google/protobuf/timestamp.pb.h"

#include "client/cli/shared/command_line.h"
#include "tissueform/v1/session.pb.h"

namespace tissueform {

// What the commands that list a server's resources have in common.

// "2026-11-23 01:10:00", local time; the same in UTC as RFC 3339 has it.
std::string TimeText(const google::protobuf::Timestamp& time);
std::string UtcTimeText(const google::protobuf::Timestamp& time);

// As plans say it: "linear_elastic".
std::string ModelText(v1::DeformationModel model);

// `name` with "COLLECTION/" before it, unless it has that.
std::string FullName(const std::string& collection, const std::string& name);

}  // namespace tissueform
