// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/instance_header.h"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/pacs_bridge/dicom/dicom_text.h"
#include "client/pacs_bridge/dicom/dicom_uid.h"
#include "core/imaging/series/image_header.h"
#include "tests/testing/ct_series.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_authority.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

InstanceHeader HeaderOf(const std::string& name, const CtSeriesOptions& options) {
  const CtSeries series = WriteCtSeries(EmptyTestFolder("header_" + name), options);
  const auto header = ReadInstanceHeader(series.files.back());
  EXPECT_THAT(header.status(), IsOk());
  return header.value_or(InstanceHeader{});
}

TEST(InstanceHeader, ReadsTheAttributesOfASlice) {
  CtSeriesOptions options;
  options.slices = 3;
  options.axes << 0, 0, 1, 1, 0, 0, 0, -1, 0;  // sagittal
  const CtSeries series = WriteCtSeries(EmptyTestFolder("header_says"), options);
  const auto header = ReadInstanceHeader(series.files[2]);
  ASSERT_THAT(header.status(), IsOk());
  EXPECT_EQ(header->study_uid, series.study_uid);
  EXPECT_EQ(header->series_uid, series.series_uid);
  EXPECT_EQ(header->instance_uid, series.instance_uids[2]);
  EXPECT_EQ(header->frame_uid, series.frame_uid);
  EXPECT_EQ(header->class_uid, kCtImageClass);
  EXPECT_EQ(header->transfer_syntax_uid, kExplicitLittleEndian);
  EXPECT_EQ(header->patient_name, "Planted^Patricia^Q");
  EXPECT_EQ(header->birth_date, "19610203");
  EXPECT_EQ(header->image_type, "ORIGINAL\\PRIMARY\\AXIAL");
  EXPECT_EQ(header->convolution_kernel, "H60s");
  EXPECT_EQ(header->instance_number, 3);
  EXPECT_EQ(header->rows, 48);
  EXPECT_EQ(header->columns, 64);
  ASSERT_TRUE(header->position_mm && header->axes && header->pixel_spacing_mm);
  EXPECT_NEAR((*header->position_mm - (options.origin_mm + Eigen::Vector3d(6, 0, 0))).norm(), 0,
              1e-9);
  EXPECT_NEAR((*header->axes - options.axes.leftCols<2>()).norm(), 0, 1e-9);
  EXPECT_EQ(header->rescale_intercept, -1024);
  EXPECT_FALSE(header->gantry_tilt_deg);
  EXPECT_EQ(header->text_problem, "");
}

TEST(InstanceHeader, UnknownCharacterSetIsReportedAndNotGuessed) {
  CtSeriesOptions options;
  options.slices = 1;
  options.character_set = "ISO_IR 4711";
  options.patient_name = "M\xFCller";
  const InstanceHeader header = HeaderOf("unknown_set", options);
  EXPECT_EQ(header.patient_name, "M?ller");
  EXPECT_THAT(header.text_problem, HasSubstr("(0010,0010) is not in the character set"));
}

TEST(InstanceHeader, AnAsciiNameNeedsNoCharacterSet) {
  CtSeriesOptions options;
  options.slices = 1;
  options.character_set = "NO SUCH SET";
  EXPECT_EQ(HeaderOf("ascii", options).patient_name, "Planted^Patricia^Q");
}

TEST(InstanceHeader, NameOfAHundredThousandCharactersIsCutAndReported) {
  CtSeriesOptions options;
  options.slices = 1;
  options.character_set = "ISO_IR 192";
  for (int i = 0; i < 50'000; ++i) options.patient_name += "é";
  for (const char* before : {"", "x"}) {
    options.patient_name = before + options.patient_name;
    const InstanceHeader header = HeaderOf("long", options);
    EXPECT_LE(header.patient_name.size(), DicomTexts::kMaxBytes);
    EXPECT_GE(header.patient_name.size(), DicomTexts::kMaxBytes - 1);
    EXPECT_THAT(header.patient_name, ::testing::EndsWith("é"));
    EXPECT_THAT(header.text_problem, HasSubstr("(0010,0010) is longer than 1024 bytes and is cut"));
  }
}

TEST(InstanceHeader, RefusesAnInvalidUidWithoutRepeatingIt) {
  CtSeriesOptions options;
  options.slices = 1;
  options.study_uid = "../../etc/planted";
  const CtSeries series = WriteCtSeries(EmptyTestFolder("header_uid"), options);
  const absl::Status status = ReadInstanceHeader(series.files[0]).status();
  EXPECT_THAT(status,
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("(0020,000d) is no UID")));
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr("planted")));
}

}  // namespace
}  // namespace tissueform::testing
