// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// What is written is opened by programs of other projects.

#include <cstdio>
#include <fstream>

#include "gmock/gmock.h"
#include "nlohmann/json.hpp"

#include "client/pacs_bridge/objects/capture_object.h"
#include "tests/client/pacs_bridge/objects/objects_fixture.h"
#include "tests/testing/test_paths.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class OtherReadersTest : public ObjectsFixture {
 protected:
  // The frames of the pictures, as they were given.
  static std::string Pixels(const std::string& picture) {
    const auto frames = ReadCaptureFrames({picture});
    EXPECT_THAT(frames.status(), IsOk());
    if (!frames.ok()) return "";
    return {frames->rgb.begin(), frames->rgb.end()};
  }

  // Writes what read_objects.py is given.
  void WriteManifest(const PredictionObjectsInput& input) const {
    std::filesystem::create_directory(folder_ / "stl");
    nlohmann::json json = {
        {"source", input.source_header}, {"uids", input.uids}, {"stl", (folder_ / "stl").string()}};
    for (const auto& [key, object] : Write(input)) json["objects"][key] = object.path;
    std::ofstream(folder_ / "manifest.json") << json;
  }
  int ReadByPydicom() const {
    return Run(absl::StrCat(
        "/usr/bin/python3 ", SourcePath("tests/client/pacs_bridge/objects/read_objects.py"), " ",
        (folder_ / "manifest.json").string(), " ", SourcePath("docs/dicom-attributes.csv")));
  }
  // Debian's own, even if another one comes first on the path.
  bool HasModule(const std::string& module) const {
    return Run("/usr/bin/python3 -c 'import " + module + "'") == 0;
  }
};

TEST_F(OtherReadersTest, DciodvfyFindsNoErrorInAnyObject) {
  ASSERT_TRUE(Has("dciodvfy")) << "dicom3tools is not installed";
  for (const auto& [key, object] : Write(MakeInput())) {
    Run("dciodvfy " + object.path);
    EXPECT_THAT(Said(), Not(HasSubstr("Error"))) << key;
    const std::string kind = key == "capture"  ? "MultiframeTrueColorSCImage"
                             : key == "report" ? "ComprehensiveSR"
                                               : "EncapsulatedSTL";
    EXPECT_THAT(Said(), HasSubstr(kind)) << key;
  }
}

TEST_F(OtherReadersTest, DciodvfyFindsNoErrorWhereTheScannerSaysLittle) {
  ASSERT_TRUE(Has("dciodvfy")) << "dicom3tools is not installed";
  PredictionObjectsInput input = MakeInput();
  const auto source = Load(input.source_header);
  for (const DcmTagKey& tag : {DCM_PatientBirthDate, DCM_PatientSex, DCM_AccessionNumber,
                               DCM_StudyID, DCM_ReferringPhysicianName, DCM_StudyTime}) {
    delete source->getDataset()->remove(tag);
  }
  input.source_header = folder_ / "little.dcm";
  ASSERT_TRUE(source->saveFile(input.source_header.c_str(), EXS_LittleEndianExplicit).good());
  for (const auto& [key, object] : Write(input)) {
    Run("dciodvfy " + object.path);
    EXPECT_THAT(Said(), Not(HasSubstr("Error"))) << key;
  }
}

TEST_F(OtherReadersTest, PydicomFindsTheDocumentedAttributes) {
  ASSERT_TRUE(HasModule("pydicom")) << "python3-pydicom is not installed";
  CtSeriesOptions options;
  options.character_set = "ISO_IR 192";
  options.patient_name = "Wang^XiaoDong=\xe7\x8e\x8b^\xe5\xb0\x8f\xe4\xb8\x9c";
  WriteManifest(MakeInput(options));
  EXPECT_EQ(ReadByPydicom(), 0) << Said();
}

TEST_F(OtherReadersTest, PydicomReportsDeviationsFromTheTable) {
  ASSERT_TRUE(HasModule("pydicom")) << "python3-pydicom is not installed";
  const PredictionObjectsInput input = MakeInput();
  WriteManifest(input);
  const std::string path = folder_ / "out" / (input.uids.at("capture") + ".dcm");
  const auto file = Load(path);
  file->getDataset()->putAndInsertString(DCM_BurnedInAnnotation, "YES");
  file->getDataset()->putAndInsertString(DCM_OperatorsName, "Somebody");
  ASSERT_TRUE(file->saveFile(path.c_str(), EXS_LittleEndianExplicit).good());
  EXPECT_EQ(ReadByPydicom(), 1);
  EXPECT_THAT(Said(), HasSubstr("capture: BurnedInAnnotation is YES"));
  EXPECT_THAT(Said(), HasSubstr("capture: OperatorsName is not in the table"));
}

TEST_F(OtherReadersTest, MeshioReadsTheStlThatPydicomTakesOut) {
  ASSERT_TRUE(HasModule("pydicom") && HasModule("meshio"))
      << "python3-pydicom or python3-meshio is not installed";
  const PredictionObjectsInput input = MakeInput();
  WriteManifest(input);
  ASSERT_EQ(ReadByPydicom(), 0) << Said();
  const Eigen::RowVector3f low = input.contents.surfaces[0].positions.colwise().minCoeff();
  ASSERT_EQ(
      Run(absl::StrCat("/usr/bin/python3 -c 'import meshio; m = meshio.read(\"",
                       (folder_ / "stl" / "stl_skin-before.stl").string(),
                       "\"); print(len(m.cells_dict[\"triangle\"]), *m.points.min(axis=0))'")),
      0)
      << Said();
  EXPECT_THAT(Said(), HasSubstr(absl::StrCat(input.contents.surfaces[0].triangles.rows(), " ")));
  double x = 0;
  double y = 0;
  double z = 0;
  ASSERT_EQ(std::sscanf(Said().c_str(), "%*d %lf %lf %lf", &x, &y, &z), 3);
  EXPECT_LT((Eigen::RowVector3d(x, y, z) - low.cast<double>()).norm(), 1e-5);
}

TEST_F(OtherReadersTest, Dcm2pnmShowsThePicturesPixels) {
  ASSERT_TRUE(Has("dcm2pnm") && Has("dcmj2pnm")) << "dcmtk is not installed";
  const PredictionObjectsInput input = MakeInput();
  const std::string capture = Write(input).at("capture").path;
  for (const char* program : {"dcm2pnm", "dcmj2pnm"}) {
    for (size_t frame = 0; frame < input.pictures.size(); ++frame) {
      const std::string ppm = folder_ / "frame.ppm";
      ASSERT_EQ(Run(absl::StrCat(program, " +op +F ", frame + 1, " ", capture, " ", ppm)), 0)
          << Said();
      const std::string pixels = Pixels(input.pictures[frame]);
      const std::string shown = BytesOfFile(ppm);
      ASSERT_GE(shown.size(), pixels.size());
      EXPECT_TRUE(shown.substr(shown.size() - pixels.size()) == pixels) << program << frame;
    }
  }
}

TEST_F(OtherReadersTest, GdcmShowsThePicturesPixels) {
  ASSERT_TRUE(Has("gdcmraw") && Has("gdcmconv")) << "libgdcm-tools is not installed";
  const PredictionObjectsInput input = MakeInput();
  // Through a compression and back, so that GDCM has to understand the frames.
  const std::string packed = folder_ / "packed.dcm";
  const std::string plain = folder_ / "plain.dcm";
  const std::string raw = folder_ / "frames.raw";
  ASSERT_EQ(Run(absl::StrCat("gdcmconv --rle ", Write(input).at("capture").path, " ", packed)), 0)
      << Said();
  ASSERT_EQ(Run(absl::StrCat("gdcmconv --raw ", packed, " ", plain)), 0) << Said();
  ASSERT_EQ(Run(absl::StrCat("gdcmraw -i ", plain, " -o ", raw)), 0) << Said();
  std::string expected;
  for (const std::string& picture : input.pictures) expected += Pixels(picture);
  EXPECT_TRUE(BytesOfFile(raw) == expected);
}

TEST_F(OtherReadersTest, DcmtkReadsTheReport) {
  ASSERT_TRUE(Has("dsrdump") && Has("dsr2xml")) << "dcmtk is not installed";
  const std::string report = Write(MakeInput()).at("report").path;
  ASSERT_EQ(Run("dsrdump +Pl " + report), 0) << Said();
  for (const char* said :
       {"Research, not a medical device", "Model\")=\"neo_hookean\"", "\"6.3246\" (mm,UCUM,",
        "\"5.7296\" (deg,UCUM,", "\"0.2500\" (mm,UCUM,", "e_line_upper_lip", "\"2.2500\" (mm",
        "contains IMAGE:", "EncapsulatedSTLStorage"}) {
    EXPECT_THAT(Said(), HasSubstr(said));
  }
  ASSERT_EQ(Run("dsr2xml " + report), 0) << Said();
  EXPECT_THAT(Said(), HasSubstr("<value>6.3246</value>"));
}

TEST_F(OtherReadersTest, ReportStatesWhatAnIntervalCovers) {
  ASSERT_TRUE(Has("dsrdump")) << "dcmtk is not installed";
  PredictionObjectsInput input = MakeInput();
  ASSERT_EQ(Run("dsrdump +Pl " + Write(input).at("report").path), 0) << Said();
  EXPECT_THAT(Said(), HasSubstr("Band of uncertainty of the material, 95 of 100 cases"));
  EXPECT_THAT(Said(), HasSubstr("After, lowest in 95 of 100 cases, of the material"));
  EXPECT_THAT(Said(), Not(HasSubstr("surgery")));
  input.measures[0].set_interval_is_whole(true);
  ASSERT_EQ(Run("dsrdump +Pl " + Write(input).at("report").path), 0) << Said();
  for (const char* said :
       {"After, lowest in 95 of 100 cases: surgery, model, material\")=\"-1.5000\"",
        "After, highest in 95 of 100 cases: surgery, model, material\")=\"-1.0000\""}) {
    EXPECT_THAT(Said(), HasSubstr(said));
  }
}

TEST_F(OtherReadersTest, AReportWithoutABandSaysWhy) {
  ASSERT_TRUE(Has("dsrdump")) << "dcmtk is not installed";
  PredictionObjectsInput input = MakeInput();
  input.why_no_band = "a segment turns by more than 30 degrees";
  ASSERT_EQ(Run("dsrdump +Pl " + Write(input).at("report").path), 0) << Said();
  EXPECT_THAT(Said(), Not(HasSubstr(input.why_no_band))) << "a band is known";
  input.band_mm.clear();
  ASSERT_EQ(Run("dsrdump +Pl " + Write(input).at("report").path), 0) << Said();
  EXPECT_THAT(Said(), HasSubstr(input.why_no_band));
  EXPECT_THAT(Said(), Not(HasSubstr("Band of uncertainty of")));
}

TEST_F(OtherReadersTest, ASourceInJpeg2000IsAsGood) {
  ASSERT_TRUE(Has("gdcmconv")) << "libgdcm-tools is not installed";
  PredictionObjectsInput input = MakeInput();
  const std::string plain = BytesOfFile(Write(input).at("stl:skin").path);
  const std::string packed = folder_ / "j2k.dcm";
  ASSERT_EQ(Run(absl::StrCat("gdcmconv --j2k ", input.source_header, " ", packed)), 0) << Said();
  input.source_header = packed;
  EXPECT_TRUE(BytesOfFile(Write(input).at("stl:skin").path) == plain);
}

}  // namespace
}  // namespace tissueform::testing
