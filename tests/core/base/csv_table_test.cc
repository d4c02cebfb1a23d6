// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/csv_table.h"

#include <fstream>
#include <sstream>

#include "gtest/gtest.h"

namespace tissueform {
namespace {

TEST(CsvTableTest, CellsWithCommasAndQuotationMarksAreQuoted) {
  CsvTable table({"case", "ratio"});
  table.AddRow({"volume, drag", Cell(0.5)});
  table.AddRow({"the \"surface\"", Cell(1)});
  EXPECT_EQ(table.Csv(), "case,ratio\n\"volume, drag\",0.5\n\"the \"\"surface\"\"\",1\n");
}

TEST(CsvTableTest, EveryRowOfAFileSaysThatItIsNoMedicalDevice) {
  CsvTable table({"a", "b"});
  table.AddRow({"1", "2"});
  const std::string path = ::testing::TempDir() + "/csv_table_test.csv";
  ASSERT_TRUE(table.WriteCsv(path).ok());
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  EXPECT_EQ(text.str(), "a,b,notice\n1,2,research software - not a medical device\n");
}

TEST(CsvTableTest, MarkdownHasARuleBelowTheHeader) {
  CsvTable table({"a", "b"});
  table.AddRow({"1", "2"});
  EXPECT_EQ(table.Markdown(), "| a | b |\n|---|---|\n| 1 | 2 |\n");
}

TEST(CsvTableTest, NumbersKeepSixDigits) {
  EXPECT_EQ(Cell(0.123456789), "0.123457");
  EXPECT_EQ(Cell(180), "180");
}

}  // namespace
}  // namespace tissueform
