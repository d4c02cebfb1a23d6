// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/dicom_uid.h"

#include <set>
#include <string>

#include <gtest/gtest.h>

namespace tissueform {
namespace {

TEST(DicomUid, NewUidsAreValidAndUnique) {
  std::set<std::string> uids;
  for (int i = 0; i < 1000; ++i) {
    const std::string uid = NewDicomUid();
    EXPECT_TRUE(IsDicomUid(uid)) << uid;
    EXPECT_EQ(uid.rfind("2.25.", 0), 0u);
    EXPECT_LE(uid.size(), 44u);
    uids.insert(uid);
  }
  EXPECT_EQ(uids.size(), 1000u);
}

TEST(DicomUid, InvalidUidIsRecognized) {
  EXPECT_TRUE(IsDicomUid("1.2.840.10008.1.1"));
  EXPECT_TRUE(IsDicomUid("1.0.3"));
  EXPECT_TRUE(IsDicomUid(std::string(64, '1')));
  for (const std::string& text : {std::string(), std::string("1..2"), std::string("1.02"),
                                  std::string(".1"), std::string("1."), std::string("../etc"),
                                  std::string("1.2 "), std::string(65, '1'), std::string("1.2*")}) {
    EXPECT_FALSE(IsDicomUid(text)) << text;
  }
}

}  // namespace
}  // namespace tissueform
